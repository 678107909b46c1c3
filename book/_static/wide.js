// Says of a table or an equation that is wider than the page that it scrolls.
const SCROLLS = ".cell_output .text_html, mjx-container[display='true']";
const marking = new ResizeObserver((entries) => {
  for (const { target } of entries)
    target.classList.toggle("wide", target.scrollWidth > target.clientWidth + 1);
});

function watch() {
  for (const element of document.querySelectorAll(SCROLLS)) marking.observe(element);
}

addEventListener("load", () => {
  watch();
  window.MathJax?.startup?.promise?.then(watch);
});
