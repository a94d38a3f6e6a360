// The one call that brings pictures.

import { type Frame, type NextFrameRequest } from "../gen/steradian/v1/view_pb.ts";
import { FRAME_PATIENCE_MS, views } from "./rpc.ts";

export type Wanted = Pick<NextFrameRequest, "view" | "encoding" | "afterFrameNumber" | "video" | "maxSize">;

/** Frames beyond those that were seen, of all views that have one. */
export async function nextFrames(wanted: Wanted[], signal: AbortSignal): Promise<Frame[]> {
  const { frames } = await views.nextFrames({ views: wanted }, { signal, timeoutMs: FRAME_PATIENCE_MS });
  return frames;
}
