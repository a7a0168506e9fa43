/** Whether the API reference was built: `npm run build -- --docs`. */
import { existsSync } from 'node:fs';

export default () => existsSync(new URL('../../dist/api/index.html', import.meta.url));
