// Messages to the user: a banner while the daemon cannot be reached, and notices about refused calls.

import { byId, make } from "./dom.ts";

/** Display time of a notice, unless it is closed. */
const SHOWN_MS = { info: 5000, warning: 15_000, error: 15_000 };
/** Maximum number of notices: further ones replace the oldest. */
const MOST = 4;

export type Kind = "info" | "warning" | "error";

/** Displays a notice, also for screen readers. A repeated text extends the existing notice. */
export function notify(text: string, kind: Kind = "info"): void {
  const list = byId("notices");
  for (const same of list.querySelectorAll("li")) if (same.dataset["text"] === text) same.remove();
  const item = make("li", { class: kind, "data-text": text }, make("span", { text }));
  const close = make("button", { type: "button", text: "Close", "aria-label": `Close: ${text}`, onclick: () => item.remove() });
  item.append(close);
  list.append(item);
  while (list.children.length > MOST) list.firstElementChild?.remove();
  setTimeout(() => item.remove(), SHOWN_MS[kind]);
}

/** Displays the banner. */
export function showBanner(title: string, text: string): void {
  byId("banner-title").textContent = title;
  byId("banner-text").textContent = text;
  byId("banner").hidden = false;
}

export function hideBanner(): void {
  byId("banner").hidden = true;
}
