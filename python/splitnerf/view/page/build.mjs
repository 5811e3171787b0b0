// Builds ../viewer.html, one file without others: the page, its style, and its script with three.js and uPlot.
import { createHash } from "node:crypto";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const text = (name) => readFileSync(join(here, name), "utf8");

/** What the page is made of, in the order of its hash: tests/python/test_view.py computes the same. */
const sources = ["build.mjs", "package-lock.json", "package.json", ...readdirSync(join(here, "src")).sort().map((name) => `src/${name}`)];
const hash = createHash("sha256");
for (const name of sources) hash.update(`${name}\n`).update(readFileSync(join(here, name)));

const options = { bundle: true, minify: true, write: false, absWorkingDir: here, legalComments: "none", charset: "utf8" };
const script = await build({ ...options, entryPoints: ["src/main.js"], format: "iife", target: "es2022" });
const style = await build({ ...options, entryPoints: ["src/style.css"] });

const licence = [["three.js", "three"], ["uPlot", "uplot"]]
  .map(([name, folder]) => `${name}:\n\n${text(`node_modules/${folder}/LICENSE`).trim()}`)
  .join("\n\n");
const insert = { HASH: hash.digest("hex"), LICENCE: licence, STYLE: style.outputFiles[0].text, SCRIPT: script.outputFiles[0].text };
insert.SCRIPT = insert.SCRIPT.replaceAll("</script", "<\\/script");
const page = text("src/page.html").replace(/\{\{(\w+)\}\}/g, (_, name) => insert[name]);
writeFileSync(join(here, "..", "viewer.html"), page);
writeFileSync(join(here, "..", "LICENSES"), `viewer.html contains the following.\n\n${licence}\n`);
console.log(`viewer.html: ${(page.length / 1024).toFixed(0)} KiB`);
