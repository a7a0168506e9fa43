import '@gaussian-splat/element';
