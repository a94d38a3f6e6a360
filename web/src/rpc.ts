// The daemon's calls over gRPC-Web, of the origin that the page comes from.

import { Code, ConnectError, createClient } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";

import { CameraService } from "../gen/steradian/v1/camera_pb.ts";
import { DiagnosticsService } from "../gen/steradian/v1/diagnostics_pb.ts";
import { SceneService } from "../gen/steradian/v1/scene_pb.ts";
import { ViewService } from "../gen/steradian/v1/view_pb.ts";
import { authorise } from "./login.ts";

const transport = createGrpcWebTransport({ baseUrl: location.origin, interceptors: [authorise] });

export const cameras = createClient(CameraService, transport);
export const scenes = createClient(SceneService, transport);
export const views = createClient(ViewService, transport);
export const diagnostics = createClient(DiagnosticsService, transport);

/** A daemon that has not answered a short call for this long is taken for gone. */
export const PATIENCE_MS = 20_000;
/** The same for frames: those of large scenes take many seconds on a software driver. */
export const FRAME_PATIENCE_MS = 60_000;

export type Failure = "ended" | "unreachable" | "conflict" | "unknown" | "refused";

/** What an error means for the page. */
export function failureOf(error: unknown): Failure {
  const { code } = ConnectError.from(error);
  switch (code) {
    case Code.Canceled:
      return "ended";
    // A fetch that fails says nothing else than that: a daemon that answers gives a code of its own.
    case Code.Unavailable:
    case Code.Unknown:
    case Code.DeadlineExceeded:
      return "unreachable";
    case Code.Aborted:
      return "conflict";
    case Code.Unauthenticated:
      return "unknown";
    default:
      return "refused";
  }
}

/** The daemon's own words. */
export function messageOf(error: unknown): string {
  const { rawMessage, code } = ConnectError.from(error);
  return rawMessage || Code[code];
}

/** Waits; ends early, without an error, when the signal is given. */
export function pause(ms: number, signal: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const end = () => {
      clearTimeout(timer);
      signal.removeEventListener("abort", end);
      resolve();
    };
    const timer = setTimeout(end, ms);
    signal.addEventListener("abort", end);
    if (signal.aborted) end();
  });
}
