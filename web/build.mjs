// Bundles the page into dist/: what is there is checked in and becomes part of the program. The same sources give the same bytes.

import { copyFile, mkdir } from "node:fs/promises";
import { fileURLToPath } from "node:url";

import { build } from "esbuild";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
// Another folder, for the test that compares.
const out = process.argv[2] ?? here("dist");

await mkdir(out, { recursive: true });
await build({
  entryPoints: [here("src/main.ts")],
  outfile: `${out}/page.js`,
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2022",
  charset: "utf8",
  legalComments: "none",
  banner: {
    js: "// Steradian, MIT OR Apache-2.0. Contains @bufbuild/protobuf (Apache-2.0 AND BSD-3-Clause) and @connectrpc/connect (Apache-2.0),\n// Copyright Buf Technologies, Inc., The Connect Authors and Google Inc.",
  },
});
await build({ entryPoints: [here("src/page.css")], outfile: `${out}/page.css`, minify: true, target: "es2022", charset: "utf8" });
for (const file of ["index.html", "icon.svg"]) await copyFile(here(`src/${file}`), `${out}/${file}`);
