// A small plot of values over time: SVG lines with one scale from 0.

const SVG = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT] = [280, 72];
/** Maximum number of points. */
const MOST = 120;

export interface Series {
  name: string;
  /** Class of its line. */
  line: string;
}

function svg<K extends keyof SVGElementTagNameMap>(tag: K, attributes: Record<string, string>): SVGElementTagNameMap[K] {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

/** Rounds up to 1, 2 or 5 times a power of ten. */
function ceiling(value: number): number {
  if (!(value > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= value * 0.999999) ?? 10;
  return step * power;
}

export class Plot {
  readonly element = document.createElement("figure");
  #picture = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", preserveAspectRatio: "none" });
  #top = document.createElement("span");
  #values = document.createElement("figcaption");
  #lines: SVGPolylineElement[];
  #points: (number | undefined)[][] = [];

  constructor(
    private readonly title: string,
    private readonly unit: string,
    private readonly series: readonly Series[],
  ) {
    this.element.className = "plot";
    this.#lines = series.map(({ line }) => svg("polyline", { class: line, "vector-effect": "non-scaling-stroke" }));
    for (const y of [0.5, HEIGHT / 2, HEIGHT - 0.5]) {
      this.#picture.append(svg("line", { x1: "0", x2: String(WIDTH), y1: String(y), y2: String(y), class: "rule", "vector-effect": "non-scaling-stroke" }));
    }
    this.#picture.append(...this.#lines);
    this.#top.className = "top";
    this.element.append(this.#values, this.#picture);
    this.#draw();
  }

  /** Adds a value for each series; with undefined, the time passes but there is no point. */
  push(...values: (number | undefined)[]): void {
    this.#points.push(values);
    if (this.#points.length > MOST) this.#points.shift();
    this.#draw();
  }

  clear(): void {
    this.#points = [];
    this.#draw();
  }

  #draw(): void {
    const largest = Math.max(0, ...this.#points.flat().filter((value) => value !== undefined));
    const top = ceiling(largest);
    this.#top.textContent = `0 to ${top} ${this.unit}`;
    this.#lines.forEach((line, index) => {
      const points = this.#points.flatMap((values, time) => {
        const value = values[index];
        if (value === undefined) return [];
        const x = WIDTH - ((this.#points.length - 1 - time) / (MOST - 1)) * WIDTH;
        return [`${x.toFixed(1)},${(HEIGHT - (value / top) * (HEIGHT - 2) - 1).toFixed(1)}`];
      });
      line.setAttribute("points", points.join(" "));
    });
    const last = this.#points.at(-1) ?? [];
    const words = this.series.map(({ name }, index) => {
      const value = last[index];
      return `${name ? `${name} ` : ""}${value === undefined ? "-" : `${value < 10 ? value.toFixed(1) : value.toFixed(0)} ${this.unit}`}`;
    });
    this.#values.replaceChildren(
      Object.assign(document.createElement("strong"), { textContent: this.title }),
      ...this.series.map(({ line }, index) =>
        Object.assign(document.createElement("span"), { className: line, textContent: words[index] ?? "" }),
      ),
      this.#top,
    );
    this.#picture.setAttribute("aria-label", `${this.title}: ${words.join(", ")}`);
  }
}
