// Searches for a body, star or constellation by name, and turns the camera to it.

import { field, make } from "./dom.ts";
import type { Flight } from "./look.ts";
import { inWords } from "./names.ts";
import { notify } from "./notices.ts";
import { PATIENCE_MS, failureOf, messageOf, scenes } from "./rpc.ts";
import type { Steering } from "./steering.ts";

export function findPanel(host: HTMLElement, steering: Steering, flight: Flight): void {
  const name = make("input", { name: "find", type: "search", spellcheck: "false", autocapitalize: "off", required: true, maxlength: 64 });
  const look = make("button", { type: "button", text: "Look at it" });
  const found = make("p", { id: "found", class: "figure", role: "status" });
  const form = make(
    "form",
    { role: "search" },
    make("h3", { text: "Find" }),
    field("Name", name, "body, star or constellation"),
    make("div", { class: "buttons" }, make("button", { type: "submit", text: "Find" }), look),
    found,
  );
  host.append(form);
  steering.addEventListener("role", () => {
    look.disabled = !steering.mayMove;
  });

  const report = (error: unknown) => {
    found.textContent = "";
    if (failureOf(error) !== "unreachable") notify(`Find: ${messageOf(error)}`, "error");
  };
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    try {
      const { object } = await scenes.find({ name: name.value.trim() }, { timeoutMs: PATIENCE_MS });
      found.textContent = object ? inWords(object) : "";
    } catch (error) {
      report(error);
    }
  });
  look.addEventListener("click", async () => {
    if (!form.reportValidity()) return;
    try {
      flight.releaseAll();
      await steering.set({ look: { at: name.value.trim() } });
      found.textContent = `The camera looks at ${name.value.trim()}.`;
    } catch (error) {
      report(error);
    }
  });
}
