// Statistics of the daemon as plots, and those of its headset. The stream of statistics also provides the first bounds
// of the clock offset.

import type { Distribution, HeadsetStats, Stats } from "../gen/steradian/v1/diagnostics_pb.ts";
import type { Ages, Quantiles } from "./ages.ts";
import { type Clock, milliseconds, now } from "./clock.ts";
import { duration, make } from "./dom.ts";
import type { Model } from "./model.ts";
import { Plot } from "./plot.ts";
import { diagnostics, pause } from "./rpc.ts";

const INTERVAL_S = 1;
/** Interval at which a background page checks whether it is visible. */
const HIDDEN_MS = 60_000;

/** Creates a list of terms and values. */
function terms(rows: readonly (readonly [term: string, value: string])[]): HTMLElement {
  return make("dl", {}, ...rows.flatMap(([term, value]) => [make("dt", { text: term }), make("dd", { text: value })]));
}

function table(caption: string, head: readonly string[], rows: readonly (readonly string[])[]): HTMLElement {
  return make(
    "table",
    {},
    make("caption", { text: caption }),
    make("thead", {}, make("tr", {}, ...head.map((text) => make("th", { scope: "col", text })))),
    make(
      "tbody",
      {},
      ...rows.map(([first, ...rest]) =>
        make("tr", {}, make("th", { scope: "row", text: first ?? "" }), ...rest.map((text) => make("td", { text }))),
      ),
    ),
  );
}

export class Statistics extends EventTarget {
  #heard: number | undefined;
  #times = new Plot("Frame", "ms", [
    { name: "whole", line: "line-a" },
    { name: "planning", line: "line-b" },
    { name: "GPU", line: "line-c" },
  ]);
  #rate = new Plot("Rendered", "/s", [{ name: "", line: "line-a" }]);
  #dropped = new Plot("Dropped by slow readers", "/s", [{ name: "", line: "line-c" }]);
  #age = new Plot("Age on this screen", "ms", [
    { name: "picture", line: "line-a" },
    { name: "camera", line: "line-b" },
  ]);
  #figures = make("div");
  #passes = make("div");
  #before: Stats | undefined;

  constructor(
    private readonly model: Model,
    private readonly clock: Clock,
    private readonly ages: Ages,
    host: HTMLElement,
    private readonly headset: HTMLElement,
  ) {
    super();
    const plots = make("div", { class: "plots" });
    plots.append(this.#times.element, this.#rate.element, this.#dropped.element, this.#age.element);
    host.append(plots, this.#figures, this.#passes);
  }

  /** Time since the last message, ms; undefined while no messages are expected. */
  silence(): number | undefined {
    return this.#heard === undefined ? undefined : now() - this.#heard;
  }

  /** Follows the statistics until the signal, the end of the stream or an error. A background page releases its connection. */
  async run(session: AbortSignal): Promise<void> {
    while (!session.aborted) {
      const turned = new AbortController();
      document.addEventListener("visibilitychange", () => turned.abort(), { once: true, signal: session });
      const signal = AbortSignal.any([session, turned.signal]);
      try {
        if (document.hidden) await pause(HIDDEN_MS, signal);
        else if (await this.#follow(signal)) return;
      } catch (error) {
        if (!turned.signal.aborted) throw error;
      } finally {
        this.#heard = undefined;
      }
    }
  }

  /** Returns whether the stream has ended by itself. */
  async #follow(signal: AbortSignal): Promise<boolean> {
    this.#before = undefined;
    const asked = now();
    this.#heard = asked;
    for await (const stats of diagnostics.watchStats({ intervalS: INTERVAL_S }, { signal })) {
      const at = now();
      this.#heard = at;
      if (stats.time) {
        const stamp = milliseconds(stats.time);
        this.clock.arrived(stamp, at);
        if (!this.#before) this.clock.stampedAfter(stamp, asked);
      }
      this.#show(stats);
    }
    return !signal.aborted;
  }

  #show(stats: Stats): void {
    const { lastFrame: frame, quality, audit } = stats;
    const before = this.#before;
    this.#before = stats;
    const wasConnected = before?.headset?.status?.connected;
    if (before && stats.headset && stats.headset.status?.connected !== wasConnected) this.dispatchEvent(new Event("headset"));
    const seconds = before?.time && stats.time ? (milliseconds(stats.time) - milliseconds(before.time)) / 1000 : 0;
    // No rates can be computed from messages in quick succession, which occur for instance when a headset connects.
    if (before && seconds > 0.5 * INTERVAL_S) {
      this.#rate.push(Number(stats.framesRendered - before.framesRendered) / seconds);
      this.#dropped.push(Number(stats.framesDropped - before.framesDropped) / seconds);
      this.#times.push(frame?.totalMs, frame?.planMs, frame?.gpuMs);
      this.#age.push(this.ages.last, this.ages.pose());
    }
    const rows: [string, string][] = [
      ["Frames rendered", stats.framesRendered.toLocaleString("en")],
      ["Frames dropped", stats.framesDropped.toLocaleString("en")],
      ["Streams, connections", `${stats.streams}, ${stats.connections}`],
      ["Images encoded", stats.encoded.toLocaleString("en")],
      ["Requests refused because of a limit", stats.refused.toLocaleString("en")],
    ];
    if (stats.framesFailed > 0n) rows.push(["Frames failed", stats.framesFailed.toLocaleString("en")]);
    if (stats.problem) rows.push(["The last frame", stats.problem]);
    if (frame) rows.push(["Objects made for the last frame", frame.objectsMade.toLocaleString("en")]);
    const ways = this.ages.ways();
    if (ways) {
      const inWords = ({ median, p99 }: Quantiles) => `median ${duration(median)}, 99 %: ${duration(p99)}`;
      rows.push([`Camera to screen, last ${ways.count} poses`, inWords(ways.whole)]);
      rows.push(["of it to the end of rendering", inWords(ways.rendered)], ["encoded and sent", inWords(ways.sent)], ["decoded and drawn", inWords(ways.drawn)]);
    }
    const clock = this.clock.offset();
    if (clock) rows.push(["Clock of the daemon", `${clock.offset >= 0 ? "+" : "−"}${duration(Math.abs(clock.offset))}, to ±${duration(clock.error)}`]);
    if (quality) {
      const smoothed = quality.smoothedMs === undefined ? "" : `, takes ${duration(quality.smoothedMs)}`;
      rows.push(["Frames in time", `${duration(quality.frameMs)} allowed${smoothed}, level ${quality.level} ${quality.givenUp.join(", ")}`]);
    }
    if (audit) {
      rows.push(["Audits", `${audit.framesAudited} frames, ${audit.framesBroken} broke a budget`]);
      const worst = audit.images.filter((image) => !image.withinBudget).map((image) => image.view + image.part);
      if (worst.length > 0) rows.push(["Last audit, over budget", worst.join(", ")]);
    }
    const { cluster } = stats;
    if (cluster) {
      rows.push(["Cluster", `${cluster.cluster}, ${cluster.process}: ${cluster.state}${cluster.reason ? `, ${cluster.reason}` : ""}`]);
      for (const node of cluster.nodes) {
        // Green: the node shows the director's scene at common times. Yellow: it has no common clock, or is joining.
        const isIn = node.state === "in" && node.sceneHash === cluster.sceneHash;
        const light = !isIn && node.state !== "out" ? "🔴" : isIn && cluster.locked ? "🟢" : "🟡";
        const ready = node.ready ? `, READY ${duration(node.ready.medianMs)}, 99 %: ${duration(node.ready.p99Ms)}` : "";
        rows.push([`${light} ${node.name}`, `${node.state}${node.reason ? `, ${node.reason}` : ""}${ready}, left out ${node.out}, refused ${node.refused}`]);
      }
    }
    const info = this.model.info;
    if (info) {
      rows.push(["Daemon", info.version], ["Adapter", `${info.adapter} (${info.deviceType})`], ["Driver", info.driver]);
      rows.push(["Stars", info.stars.toLocaleString("en")]);
      for (const fallback of info.fallbacks) rows.push(["Fallback", fallback]);
    }
    this.#figures.replaceChildren(terms(rows));
    const passes = frame?.passes ?? [];
    this.#passes.replaceChildren();
    if (passes.length > 0) {
      const sorted = [...passes].sort((a, b) => b.ms - a.ms);
      this.#passes.append(table("Passes of the last frame", ["Pass", "ms"], sorted.map(({ name, ms }) => [name, ms.toFixed(2)])));
    }
    this.#showHeadset(stats.headset);
  }

  #showHeadset(stats: HeadsetStats | undefined): void {
    const status = stats?.status;
    if (!stats || !status) {
      this.headset.replaceChildren(make("p", { class: "hint", text: "The daemon drives no headset (headset.enabled in its configuration)." }));
      return;
    }
    const spread = (d: Distribution) => [d.medianMs, d.p95Ms, d.maxMs].map((ms) => ms.toFixed(2));
    const rows: [string, string][] = [
      ["View", status.view],
      ["State", status.connected ? status.sessionState : status.retrying ? "not connected, trying again" : "given up"],
    ];
    if (status.reason) rows.push(["Reason", status.reason]);
    if (status.connected) {
      rows.push(["System", status.system], ["Runtime", status.runtime], ["Adapter", status.adapter]);
      rows.push(["Images", status.images.map(({ part, width, height }) => `${part} ${width} × ${height}`).join(", ")]);
    }
    rows.push(
      ["Refresh", stats.periodMs > 0 ? `${stats.periodMs.toFixed(2)} ms` : "not known"],
      ["Sessions, losses", `${stats.sessions}, ${stats.losses}`],
      ["Frames", `${stats.rendered} of ${stats.frames} rendered, ${stats.missed} refreshes missed, ${stats.leftOut} left out`],
    );
    const stages = stats.stages.flatMap(({ name, time }) => (time ? [[name, ...spread(time)]] : []));
    for (const [name, age] of [
      ["pose age at submission", stats.poseAgeAtSubmission],
      ["pose age at display", stats.poseAgeAtDisplay],
    ] as const) {
      if (age) stages.push([name, ...spread(age)]);
    }
    this.headset.replaceChildren(terms(rows));
    if (stages.length > 0) this.headset.append(table("Stages of a frame", ["Stage", "median, ms", "95 %", "most"], stages));
  }
}
