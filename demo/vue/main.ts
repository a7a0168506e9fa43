/** The app of the page Vue. With scenes in the address it is what tests drive. */
import '@gaussian-splat/element';
import { createApp } from 'vue';
import Harness from './Harness.vue';
import Product from './Product.vue';

const isTested = new URLSearchParams(location.search).has('first');
createApp(isTested ? Harness : Product).mount('#app');
