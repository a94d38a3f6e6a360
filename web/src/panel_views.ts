// Views of the daemon: the list, from which views are deleted, and a form that creates one. The daemon validates all values.

import type { MessageInitShape } from "@bufbuild/protobuf";

import type { ViewDefinitionSchema } from "../gen/steradian/v1/view_pb.ts";
import { field, make, numberInput, numberOf, select } from "./dom.ts";
import type { Model } from "./model.ts";
import { notify } from "./notices.ts";

type Definition = MessageInitShape<typeof ViewDefinitionSchema>;
type AngleKey = "fovYDeg" | "fovDeg" | "tiltDeg";

/** Types that a form can describe: a cubemap has one side, stereo needs the edges of an eye. */
const TYPES = [
  ["perspective", "window (perspective)"],
  ["dome_master", "dome"],
  ["fisheye", "fisheye"],
  ["equirectangular", "whole sky"],
  ["cubemap", "cube"],
] as const;

/** Angles of a type: key, name of the field, label, first value. */
const ANGLES: Record<string, readonly (readonly [key: AngleKey, name: string, label: string, first: number])[]> = {
  perspective: [["fovYDeg", "fov_y_deg", "Field of view, vertical", 60]],
  dome_master: [
    ["fovDeg", "fov_deg", "Field of view", 180],
    ["tiltDeg", "tilt_deg", "Tilt to the front", 0],
  ],
  fisheye: [["fovDeg", "fov_deg", "Field of view", 180]],
};
const MAPPINGS = ["equidistant", "equisolid", "orthographic", "stereographic"].map((name) => [name, name] as const);

export function viewsPanel(host: HTMLElement, model: Model): void {
  const list = make("ul", { class: "plain", id: "view-list" });
  const name = make("input", { name: "view", type: "text", spellcheck: "false", autocapitalize: "off", required: true, maxlength: 64 });
  const type = select("type", TYPES, "perspective");
  const keys = make("div");
  const create = make("button", { type: "submit", text: "Create" });
  const form = make(
    "form",
    { id: "view-form" },
    make("h3", { text: "Views" }),
    list,
    field("Name", name),
    field("Type", type),
    keys,
    make("div", { class: "buttons" }, create),
  );
  host.append(form);

  let width = numberInput("width", 640);
  let height = numberInput("height", 400);
  let mapping: HTMLSelectElement | undefined;
  let angles: readonly (readonly [AngleKey, HTMLInputElement])[] = [];
  const arrange = () => {
    const kind = type.value;
    const isRound = kind === "dome_master" || kind === "fisheye" || kind === "cubemap";
    width = numberInput("width", isRound ? 512 : kind === "equirectangular" ? 1024 : 640);
    height = numberInput("height", kind === "perspective" ? 400 : 512);
    mapping = kind === "fisheye" ? select("mapping", MAPPINGS, "equidistant") : undefined;
    const described = ANGLES[kind] ?? [];
    angles = described.map(([key, label, , first]) => [key, numberInput(label, first)] as const);
    keys.replaceChildren(
      field(kind === "cubemap" ? "Side of a face" : "Width", width, "pixels"),
      ...(kind === "cubemap" ? [] : [field("Height", height, "pixels")]),
      ...(mapping ? [field("Mapping", mapping)] : []),
      ...described.map(([, , label], index) => field(label, angles[index]![1], "°")),
    );
  };
  type.addEventListener("change", arrange);
  arrange();

  /** Returns the number of pixels in an input. The protocol can only express whole numbers. */
  const pixels = (input: HTMLInputElement): number => {
    const value = numberOf(input);
    if (value === undefined || !Number.isInteger(value) || value < 1 || value > 65_536) {
      throw new Error(`${input.name} = ${input.value}: must be a whole number of pixels, 1 to 65536`);
    }
    return value;
  };
  const definition = (): Definition => {
    const made: Definition = { name: name.value.trim(), type: type.value };
    if (type.value === "cubemap") made.faceSize = pixels(width);
    else made.size = [pixels(width), pixels(height)];
    if (mapping) made.mapping = mapping.value;
    for (const [key, input] of angles) made[key] = numberOf(input);
    return made;
  };

  model.addEventListener("change", () => {
    const revision = model.scene?.revision ?? 0n;
    const mayChange = model.info?.role !== "view";
    create.disabled = !mayChange;
    list.replaceChildren(
      ...model.views.map((view) => {
        const sizes = view.images.map(({ width: w, height: h }) => `${w} × ${h}`);
        const remove = make("button", {
          type: "button",
          text: "Delete",
          "aria-label": `Delete the view ${view.name}`,
          disabled: !mayChange || view.type === "headset",
          onclick: async () => {
            if (await model.deleteView(view.name, revision)) notify(`View ${view.name} is deleted.`);
          },
        });
        return make("li", {}, make("span", { text: `${view.name}: ${view.type}, ${[...new Set(sizes)].join(", ")}` }), remove);
      }),
    );
  });
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    try {
      const wanted = definition();
      if (!(await model.createView(wanted, model.scene?.revision ?? 0n))) return;
      notify(`View ${wanted.name} is created.`);
      name.value = "";
    } catch (error) {
      notify(String(error), "error");
    }
  });
}
