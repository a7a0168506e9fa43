/** axe-core, on the page or on one element. */
import { assert, nextEvent } from './harness.js';

interface AxeResults {
  readonly violations: readonly {
    readonly id: string;
    readonly help: string;
    readonly nodes: readonly { readonly html: string }[];
  }[];
  readonly passes: readonly { readonly id: string }[];
}
interface Axe {
  run(context: Document, options?: object): Promise<AxeResults>;
}

async function axeIn(page: Document): Promise<Axe> {
  const scope = page.defaultView as (Window & { axe?: Axe }) | null;
  assert(scope, 'a window');
  if (scope.axe) return scope.axe;
  const script = page.createElement('script');
  script.src = '/node_modules/axe-core/axe.min.js';
  const loaded = nextEvent(script, 'load');
  page.head.append(script);
  await loaded;
  assert(scope.axe, 'axe');
  return scope.axe;
}

export async function violations(page: Document, options?: object): Promise<string[]> {
  const { violations, passes } = await (await axeIn(page)).run(page, options);
  assert(passes.length > 0, 'axe has checked something');
  return violations.map(
    ({ id, help, nodes }) => `${id}: ${help}: ${nodes.map(({ html }) => html.slice(0, 160)).join(' | ')}`,
  );
}

/** Only the element: the test's own page has no title, no landmarks and no heading. */
export const ELEMENT_ONLY = {
  rules: Object.fromEntries(
    ['document-title', 'html-has-lang', 'landmark-one-main', 'page-has-heading-one', 'region'].map((id) => [
      id,
      { enabled: false },
    ]),
  ),
};

/** Violations that axe finds in an element. */
export async function violationsIn(element: Element): Promise<string[]> {
  return violations(element.ownerDocument, ELEMENT_ONLY);
}
