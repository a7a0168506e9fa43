/** Tabs as assistive technology knows them: one is in the order of the keyboard, arrows lead to the others. */

/** @param tabs {HTMLElement} holds a `tablist` and the panels that its tabs name. */
export function bringTabsToLife(tabs) {
  const all = [...tabs.querySelectorAll('[role=tab]')];
  const select = (chosen) => {
    for (const tab of all) {
      tab.setAttribute('aria-selected', String(tab === chosen));
      tab.tabIndex = tab === chosen ? 0 : -1;
      document.getElementById(tab.getAttribute('aria-controls')).hidden = tab !== chosen;
    }
  };
  for (const [i, tab] of all.entries()) {
    tab.addEventListener('click', () => select(tab));
    tab.addEventListener('keydown', ({ key }) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[key];
      if (step === undefined) return;
      const next = all[(i + step + all.length) % all.length];
      select(next);
      next.focus();
    });
  }
  select(all[0]);
}
