// Keeps the options of a command whole, which would break behind their dashes.
function keepOptions() {
  for (const place of document.querySelectorAll(".highlight pre, .cell_output table.sentences td")) {
    const texts = document.createTreeWalker(place, NodeFilter.SHOW_TEXT);
    const found = [];
    while (texts.nextNode()) if (/(^|\s)--?[a-z]/.test(texts.currentNode.data)) found.push(texts.currentNode);
    for (const text of found) {
      const parts = text.data.split(/(?<=^|\s)(--?[a-z][\w-]*)/);
      text.replaceWith(...parts.map((part, k) => {
        if (k % 2 === 0) return part;
        const option = document.createElement("span");
        option.className = "option";
        option.textContent = part;
        return option;
      }));
    }
  }
}

addEventListener("DOMContentLoaded", keepOptions);

// Says of a table or an equation that is wider than the page that it scrolls.
const SCROLLS = ".cell_output .text_html, .pst-scrollable-table-container, mjx-container[display='true']";
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
