// A WebAssembly program in Node, in the folder in which this is called: node run.mjs driver.wasm
import { readFile } from "node:fs/promises";
import { WASI } from "node:wasi";
import { argv, cwd, exit } from "node:process";

const wasi = new WASI({ version: "preview1", args: ["driver"], preopens: { ".": cwd() }, returnOnExit: true });
const program = await WebAssembly.compile(await readFile(argv[2]));
exit(wasi.start(await WebAssembly.instantiate(program, wasi.getImportObject())));
