// The failure tests of the daemon's adapter. Cancelling the call stops them.

import { VerifyResult_Outcome as Outcome, type VerifyFigure, type VerifyResult } from "../gen/steradian/v1/diagnostics_pb.ts";
import { field, make } from "./dom.ts";
import { notify } from "./notices.ts";
import { diagnostics, failureOf, messageOf } from "./rpc.ts";

const OUTCOMES: Record<Outcome, readonly [text: string, className: string]> = {
  [Outcome.OUTCOME_UNSPECIFIED]: ["no result", "fail"],
  [Outcome.PASS]: ["pass", "pass"],
  [Outcome.FAIL]: ["fail", "fail"],
  [Outcome.NOT_APPLICABLE]: ["not applicable", "none"],
};

const number = (value: number): string => (value !== 0 && (Math.abs(value) < 1e-3 || Math.abs(value) >= 1e5) ? value.toExponential(2) : String(Number(value.toPrecision(4))));

function figure({ what, measured, limit, unit, pass }: VerifyFigure): HTMLElement {
  const text = `${what}: ${number(measured)}${limit === undefined ? "" : ` of ${number(limit)}`} ${unit}`;
  return make("li", { class: pass ? "" : "fail", text });
}

function row(result: VerifyResult): HTMLElement {
  const [text, className] = OUTCOMES[result.outcome];
  const figures = result.message
    ? make("td", { text: result.message })
    : make("td", {}, make("ul", { class: "plain figures" }, ...result.figures.map(figure)));
  return make(
    "tr",
    { class: className },
    make("th", { scope: "row" }, make("strong", { text: result.name }), make("br"), make("small", { text: result.group })),
    make("td", { class: "outcome", text }),
    figures,
    make("td", { class: "number", text: result.seconds.toFixed(1) }),
  );
}

export function checksPanel(host: HTMLElement): void {
  const filter = make("input", { name: "filter", type: "text", spellcheck: "false" });
  const method = make("input", { name: "star_method", type: "text", spellcheck: "false" });
  const start = make("button", { type: "submit", text: "Run" });
  const stop = make("button", { type: "button", text: "Stop", disabled: true });
  const sum = make("p", { role: "status", id: "checks-sum" });
  const rows = make("tbody");
  const head = ["Check", "Outcome", "Figures", "s"].map((text) => make("th", { scope: "col", text }));
  const results = make("table", { class: "checks", hidden: true }, make("thead", {}, make("tr", {}, ...head)), rows);
  const form = make(
    "form",
    {},
    field("Checks", filter, "name, group or number; empty: all"),
    field("Star method", method, "empty: the one in use"),
    make("div", { class: "buttons" }, start, stop),
    make("p", { class: "hint", text: "They run while frames are drawn. On a software driver, some tests take many seconds." }),
  );
  host.append(form, sum, results);

  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const ended = new AbortController();
    const cancel = () => ended.abort();
    stop.addEventListener("click", cancel);
    [start.disabled, stop.disabled, results.hidden] = [true, false, true];
    rows.replaceChildren();
    sum.textContent = "Running …";
    const counts = new Map<Outcome, number>();
    const summarise = (end: string) => {
      const parts = [...counts].map(([outcome, count]) => `${count} ${OUTCOMES[outcome][0]}`);
      sum.textContent = `${parts.join(", ") || "No result"}. ${end}`;
    };
    try {
      const request = { filter: filter.value.trim(), starMethod: method.value.trim() };
      for await (const result of diagnostics.verify(request, { signal: ended.signal })) {
        results.hidden = false;
        rows.append(row(result));
        counts.set(result.outcome, (counts.get(result.outcome) ?? 0) + 1);
        summarise("Running …");
      }
      summarise("Done.");
    } catch (error) {
      const stopped = failureOf(error) === "ended";
      summarise(stopped ? "Stopped." : "Ended by an error.");
      if (!stopped) notify(`Checks: ${messageOf(error)}`, "error");
    } finally {
      stop.removeEventListener("click", cancel);
      [start.disabled, stop.disabled] = [false, true];
    }
  });
}
