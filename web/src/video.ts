// Decodes H.264 with the browser's decoder, which exists only in secure contexts: over https, or on the local machine.

import type { Image } from "../gen/steradian/v1/view_pb.ts";

/** Constrained baseline, level 5.2: the maximum that the daemon sends. The stream contains the actual parameters. */
const DECODER: VideoDecoderConfig = { codec: "avc1.424034", optimizeForLatency: true };

/** Whether the browser can decode the daemon's video. */
export async function decodesVideo(): Promise<boolean> {
  if (!("VideoDecoder" in globalThis)) return false;
  try {
    return (await VideoDecoder.isConfigSupported(DECODER)).supported === true;
  } catch {
    return false;
  }
}

interface Waiting {
  resolve: (frame: VideoFrame) => void;
  reject: (error: unknown) => void;
}

/** Decodes the pictures of one image, in the order of their arrival. */
export class Video {
  #decoder: VideoDecoder | undefined;
  #waiting = new Map<number, Waiting>();
  #next = 0;

  /** Returns the picture, which the caller must close. After an error, only a key picture can be decoded. */
  decode({ data, keyFrame }: Image): Promise<VideoFrame> {
    if (keyFrame && this.#decoder?.state !== "configured") this.#begin();
    const decoder = this.#decoder;
    if (decoder?.state !== "configured") return Promise.reject(new Error("the previous picture is missing"));
    const timestamp = this.#next++;
    return new Promise((resolve, reject) => {
      this.#waiting.set(timestamp, { resolve, reject });
      decoder.decode(new EncodedVideoChunk({ type: keyFrame ? "key" : "delta", timestamp, data: data as Uint8Array<ArrayBuffer> }));
    });
  }

  #begin(): void {
    this.close();
    this.#decoder = new VideoDecoder({
      output: (frame) => {
        const waiting = this.#waiting.get(frame.timestamp);
        this.#waiting.delete(frame.timestamp);
        if (waiting) waiting.resolve(frame);
        else frame.close();
      },
      error: (error) => this.#fail(error),
    });
    this.#decoder.configure(DECODER);
  }

  #fail(error: unknown): void {
    for (const { reject } of this.#waiting.values()) reject(error);
    this.#waiting.clear();
  }

  close(): void {
    if (this.#decoder && this.#decoder.state !== "closed") this.#decoder.close();
    this.#decoder = undefined;
    this.#fail(new Error("the view is hidden"));
  }
}
