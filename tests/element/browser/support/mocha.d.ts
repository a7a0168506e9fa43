/** The part of Mocha's global interface that the browser tests use. */
interface MochaContext {
  /** Marks the running test as skipped and leaves it. */
  skip(): never;
}
interface MochaTest {
  /** Milliseconds after which the test has failed. */
  timeout(limitMs: number): MochaTest;
}
type MochaBody = (this: MochaContext) => void | Promise<void>;
declare function describe(title: string, body: () => void): void;
type MochaIt = (title: string, body: MochaBody) => MochaTest;
declare const it: MochaIt & { readonly skip: MochaIt };
declare function before(body: MochaBody): void;
declare function after(body: MochaBody): void;
declare function beforeEach(body: MochaBody): void;
declare function afterEach(body: MochaBody): void;
