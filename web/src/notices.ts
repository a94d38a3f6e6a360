// What the page tells: a banner while the daemon cannot be reached, and notices of what was refused.

import { byId, make } from "./dom.ts";

/** A notice stays for this long; it can be closed before. */
const SHOWN_MS = { info: 5000, warning: 15_000, error: 15_000 };
/** More would cover the page: the oldest goes. */
const MOST = 4;

export type Kind = "info" | "warning" | "error";

/** Tells something once, aloud for screen readers. The same words again only make the notice stay. */
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

/** The banner over the page. */
export function showBanner(title: string, text: string): void {
  byId("banner-title").textContent = title;
  byId("banner-text").textContent = text;
  byId("banner").hidden = false;
}

export function hideBanner(): void {
  byId("banner").hidden = true;
}
