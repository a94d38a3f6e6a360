// Creates elements from code, because the page's policy forbids markup in strings.

type Child = Node | string;

interface Properties {
  class?: string;
  text?: string;
  // Attributes; a value of false omits the attribute.
  [name: string]: string | number | boolean | ((event: Event) => void) | undefined;
}

/** Creates an element with attributes, listeners (`on...`) and children. */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Properties = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === false) continue;
    if (typeof value === "function") element.addEventListener(name.slice(2), value);
    else if (name === "text") element.textContent = String(value);
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  element.append(...children);
  return element;
}

/** Returns the element with this id, which index.html must contain. */
export function byId(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (!element) throw new Error(`index.html has no element #${id}`);
  return element;
}

/** Formats milliseconds. */
export function duration(ms: number): string {
  if (ms < 10) return `${ms.toFixed(1)} ms`;
  if (ms < 1000) return `${ms.toFixed(0)} ms`;
  return `${(ms / 1000).toFixed(ms < 10_000 ? 2 : 1)} s`;
}

/** Formats a number with enough digits to read it back. */
export function plain(value: number): string {
  return String(Number(value.toPrecision(9)));
}

/** Calls `edited` whenever a field of a form is edited. A form filler that clears a field causes the event `change`, but not `input`. */
export function onEdit(form: HTMLElement, edited: () => void): void {
  for (const kind of ["input", "change"]) form.addEventListener(kind, edited);
}

let lastId = 0;

/** Creates a label with its control. The control gets an id, which the label refers to. */
export function field(label: string, control: HTMLInputElement | HTMLSelectElement, unit = ""): HTMLElement {
  control.id ||= `field-${++lastId}`;
  const caption = make("label", { for: control.id, text: label });
  if (unit) caption.append(" ", make("span", { class: "unit", text: unit }));
  return make("div", { class: "field" }, caption, control);
}

/** Creates a number input that accepts any step, because the daemon validates values. */
export function numberInput(name: string, value?: number): HTMLInputElement {
  const input = make("input", { type: "number", step: "any", name, inputmode: "decimal" });
  if (value !== undefined) input.value = plain(value);
  return input;
}

/** Creates a choice of values. */
export function select(name: string, values: readonly (readonly [value: string, text: string])[], chosen: string): HTMLSelectElement {
  const options = values.map(([value, text]) => make("option", { value, text, selected: value === chosen }));
  return make("select", { name }, ...options);
}

/** Returns the number in an input, or undefined if it is empty. The error for other values names the field. */
export function numberOf(input: HTMLInputElement): number | undefined {
  if (input.validity.badInput) throw new Error(`${input.name}: must be a number`);
  if (input.value.trim() === "") return undefined;
  const value = Number(input.value);
  if (!Number.isFinite(value)) throw new Error(`${input.name}: must be a number`);
  return value;
}
