// Draws at once what is in the window, other parts when they come near it or while the page rests, all before it is printed.
"use strict";
function later(places, draw) {
  const left = new Set(places);
  const now = (place) => {
    if (!left.delete(place)) return;
    watch.unobserve(place);
    draw(place);
  };
  const watch = new IntersectionObserver((seen) => {
    for (const { isIntersecting, target } of seen) if (isIntersecting) now(target);
  }, { rootMargin: "50% 0px" });
  const calm = (act) => (window.requestIdleCallback ? requestIdleCallback(act, { timeout: 1000 }) : setTimeout(act, 100));
  const rest = () => {
    const next = [...left].find((place) => place.getClientRects().length);  // what is folded away is drawn when it is opened
    if (next) { now(next); calm(rest); }
  };
  for (const place of [...left]) {
    const box = place.getBoundingClientRect();
    if (box.height && box.top < innerHeight && box.bottom > 0) now(place);
    else watch.observe(place);
  }
  addEventListener("load", () => setTimeout(() => calm(rest), 1000));
  addEventListener("beforeprint", () => [...left].forEach(now));
}
