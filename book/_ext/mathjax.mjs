// Makes book/_static/mathjax/mathjax.js: of MathJax what the book's formulae need, TeX with amsmath drawn as SVG.
//
//     cd book/_ext && npm install --no-save mathjax-full@3.2.2 esbuild@0.25.0 && node mathjax.mjs
//
// A check of the built book finds formulae with a character that is not among GLYPHS.
import { createRequire } from "node:module";
import { build } from "esbuild";

const require = createRequire(import.meta.url);
const GLYPHS = [
  [0x20, 0x7e], [0xa0, 0xff], [0x300, 0x333], [0x391, 0x3f5], // Latin, accents, Greek
  [0x2016, 0x2063], [0x210e, 0x2113], [0x2190, 0x2194], [0x21d0, 0x21d4], // dots, bars, arrows
  [0x2200, 0x223c], [0x2245, 0x2265], [0x22a4, 0x22a5], [0x22c5, 0x22f1], // operators and relations
  [0x2308, 0x230b], [0x239b, 0x23e1], [0x27e8, 0x27ef], [0xe150, 0xe156], // brackets and their pieces
  [0x1d400, 0x1d467], [0x1d6e2, 0x1d71b], // bold and italic letters
];
const UNUSED = /monospace|sans-serif|oldstyle|fraktur|bold-italic|calligraphic-bold/;
const COMPONENTS = {
  "startup/init": ["loader", "startup"],
  "core/core": ["core"],
  "input/tex-base/lib/tex-base": ["input/tex-base"],
  "input/tex/extensions/ams/ams": ["[tex]/ams"],
  "output/svg/svg": ["output/svg"],
  "output/svg/fonts/tex/tex": ["output/svg/fonts/tex"],
  "a11y/assistive-mml/assistive-mml": ["a11y/assistive-mml"],
};

function usedGlyphs({ path }) {
  const used = ([code]) => !UNUSED.test(path) && GLYPHS.some(([first, last]) => first <= code && code <= last);
  const fonts = Object.entries(require(path)).map(([name, glyphs]) => {
    const kept = Object.fromEntries(Object.entries(glyphs).filter(used));
    return `exports.${name} = ${JSON.stringify(kept)};`;
  });
  return { contents: fonts.join("\n"), loader: "js" };
}

const source = [
  ...Object.keys(COMPONENTS).map((name) => `import "mathjax-full/components/src/${name}.js";`),
  `import { Loader } from "mathjax-full/js/components/loader.js";`,
  `import { registerTeX } from "mathjax-full/components/src/input/tex/register.js";`,
  `registerTeX(["base", "ams"]);`,
  `Loader.preLoad(...${JSON.stringify(Object.values(COMPONENTS).flat())});`,
  `import "mathjax-full/components/src/startup/startup.js";`,
];
await build({
  stdin: { contents: source.join("\n"), resolveDir: "." },
  bundle: true,
  minify: true,
  target: "es2019",
  define: { global: "window", __dirname: '""', PACKAGE_VERSION: '"3.2.2"' },
  plugins: [{ name: "glyphs", setup: (b) => b.onLoad({ filter: /svg\/fonts\/tex\/[\w-]+\.js$/ }, usedGlyphs) }],
  outfile: "../_static/mathjax/mathjax.js",
});
