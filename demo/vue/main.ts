/** A Vue app around the element. */
import '@gaussian-splat/element';
import { createApp } from 'vue';
import App from './App.vue';

createApp(App).mount('#app');
