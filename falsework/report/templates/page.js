// Pictures open large; Escape or a click closes them.
"use strict";
(() => {
  const large = document.querySelector("dialog.large");
  const picture = large.querySelector("img"), words = large.querySelector("figcaption");
  document.addEventListener("click", (event) => {
    const small = event.target.closest(".sheet img, .triples img");
    if (!small) return;
    picture.src = small.src;
    picture.alt = small.alt;
    words.textContent = small.alt;
    if (small.dataset.file) {
      const link = document.createElement("a");
      link.href = small.dataset.file;
      link.textContent = "the file itself";
      words.append(" · ", link);
    }
    large.showModal();
  });
  large.addEventListener("click", (event) => { if (event.target.tagName !== "A") large.close(); });
})();
