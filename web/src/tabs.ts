// Tabs as described in the ARIA Authoring Practices: the active one is in the tab order, arrow keys reach the others.

export function tabs(list: HTMLElement): void {
  const all = [...list.querySelectorAll<HTMLElement>("[role=tab]")];
  const select = (chosen: HTMLElement) => {
    for (const tab of all) {
      const on = tab === chosen;
      tab.setAttribute("aria-selected", String(on));
      tab.tabIndex = on ? 0 : -1;
      const panel = document.getElementById(tab.getAttribute("aria-controls") ?? "");
      if (panel) panel.hidden = !on;
    }
    // Each panel starts at its top. On phones, the whole page scrolls and keeps its position.
    if (list.parentElement) list.parentElement.scrollTop = 0;
  };
  for (const tab of all) tab.addEventListener("click", () => select(tab));
  list.addEventListener("keydown", (event) => {
    const at = all.findIndex((tab) => tab === document.activeElement);
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: all.length - 1 }[event.key];
    if (at < 0 || to === undefined) return;
    const tab = all[(to + all.length) % all.length];
    if (!tab) return;
    tab.focus();
    select(tab);
    event.preventDefault();
  });
}
