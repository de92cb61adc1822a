// Bundles the viewer into the Python package, with the licences of everything in the bundle.
// Options: --out FOLDER writes elsewhere, for comparing with what is committed.
import { build } from "esbuild";
import { mkdir, readFile, readdir, writeFile } from "node:fs/promises";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";

const root = join(dirname(fileURLToPath(import.meta.url)), "..");
const option = process.argv.indexOf("--out");
const target =
  option > 0 ? resolve(process.argv[option + 1]) : join(root, "../src/colift/show/viewer/assets");

const { metafile } = await build({
  absWorkingDir: root,
  entryPoints: { viewer: "src/main.ts" },
  outdir: target,
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2023",
  charset: "ascii",
  legalComments: "none",
  metafile: true,
  logLevel: "warning",
});

const packages = new Set();
for (const output of Object.values(metafile.outputs)) {
  for (const [input, { bytesInOutput }] of Object.entries(output.inputs)) {
    const match = input.match(/node_modules\/((?:@[^/]+\/)?[^/]+)\//);
    if (match && bytesInOutput > 0) packages.add(match[1]);
  }
}
const texts = [];
for (const name of [...packages].sort()) {
  const folder = join(root, "node_modules", name);
  const { version, license } = JSON.parse(await readFile(join(folder, "package.json"), "utf8"));
  const file = (await readdir(folder)).find((entry) => /^licen[cs]e/i.test(entry));
  if (!file) throw new Error(`${name} carries no licence file`);
  const text = (await readFile(join(folder, file), "utf8")).trim();
  texts.push(`${name} ${version} (${license})\n\n${text}\n`);
}
await mkdir(target, { recursive: true });
await writeFile(
  join(target, "LICENSES.txt"),
  `viewer.js and viewer.css contain the following packages.\n\n${texts.join(`\n${"-".repeat(80)}\n\n`)}`,
);
