// Snapshots: states of scene, views and camera under names.

import { milliseconds } from "./clock.ts";
import { field, make } from "./dom.ts";
import type { Model } from "./model.ts";
import { notify } from "./notices.ts";
import { PATIENCE_MS, failureOf, messageOf, scenes } from "./rpc.ts";

export function snapshotsPanel(host: HTMLElement, model: Model): void {
  const name = make("input", { name: "snapshot", type: "text", spellcheck: "false", autocapitalize: "off", required: true, maxlength: 64 });
  const list = make("ul", { class: "plain", id: "snapshots" });
  const save = make("button", { type: "submit", text: "Save" });
  const form = make("form", {}, make("h3", { text: "Snapshots" }), list, field("Name", name), make("div", { class: "buttons" }, save));
  host.append(form);

  // Answers may arrive in another order than their requests: show only the answer to the last request.
  let questions = 0;
  const read = async () => {
    const question = ++questions;
    const role = model.info?.role;
    try {
      const { snapshots } = await scenes.listSnapshots({}, { timeoutMs: PATIENCE_MS });
      if (question !== questions) return;
      save.disabled = role === "view";
      list.replaceChildren(
        ...snapshots.map(({ name: saved, time }) => {
          const text = time ? `${saved}, ${new Date(milliseconds(time)).toLocaleString("en")}` : saved;
          const load = make("button", {
            type: "button",
            text: "Load",
            "aria-label": `Load the snapshot ${saved}`,
            disabled: role !== "admin",
            onclick: () => void act(`Snapshot ${saved} is loaded.`, () => scenes.loadSnapshot({ name: saved }, { timeoutMs: PATIENCE_MS })),
          });
          return make("li", {}, make("span", { text }), load);
        }),
      );
      if (snapshots.length === 0) list.append(make("li", { class: "hint", text: "None." }));
    } catch (error) {
      if (question !== questions) return;
      // A daemon without a state file has no snapshots.
      save.disabled = true;
      if (failureOf(error) === "refused") list.replaceChildren(make("li", { class: "hint", text: messageOf(error) }));
    }
  };
  const act = async (done: string, call: () => Promise<unknown>) => {
    try {
      await call();
      notify(done);
      await model.refresh();
    } catch (error) {
      notify(`Snapshots: ${messageOf(error)}`, "error");
    }
    await read();
  };
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const saved = name.value.trim();
    void act(`Snapshot ${saved} is saved.`, () => scenes.saveSnapshot({ name: saved }, { timeoutMs: PATIENCE_MS }));
  });
  // Other clients may save snapshots too, so read the list whenever the panel is opened.
  model.addEventListener("loaded", () => void read());
  document.getElementById("tab-scene")?.addEventListener("click", () => void read());
}
