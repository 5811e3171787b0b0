// Builds ../report/pages.js, the one script of report.html and of the page of splitnerf view, styles included.
import { createHash } from "node:crypto";
import { readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const out = join(here, "../report");
const text = (name) => readFileSync(join(here, name), "utf8");

const built = await build({
  entryPoints: ["main.js"], bundle: true, minify: true, write: false, absWorkingDir: here, legalComments: "none", charset: "utf8",
  format: "iife", target: "es2022", loader: { ".css": "text" }, metafile: true,
});
const own = Object.keys(built.metafile.inputs).filter((name) => !name.startsWith("node_modules/")).sort();
const hash = createHash("sha256"); // tests/python/test_built_pages.py computes the same
for (const name of ["build.mjs", "package-lock.json", "package.json", ...own]) hash.update(`${name}\n`).update(readFileSync(join(here, name)));
const licences = ["three", "uplot"].map((name) => `${name}:\n\n${text(`node_modules/${name}/LICENSE`).trim()}`).join("\n\n\n");
// Within an element of a page nothing in a script may look like the element's end.
const script = built.outputFiles[0].text.replaceAll("</script", "<\\/script").replaceAll("<!--", "<\\!--");
const bundle = `/* sources ${hash.digest("hex")}: ${own.join(" ")}\ncontains ${licences}\n*/\n${script}`;
writeFileSync(join(out, "pages.js"), bundle);
writeFileSync(join(out, "LICENSES"), `pages.js contains ${licences}\n`);
console.log(`pages.js: ${(bundle.length / 1024).toFixed(0)} KiB`);
