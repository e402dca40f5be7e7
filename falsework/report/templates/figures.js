// Draws each figure of the page in the colours of light or dark, anew when the reader changes between them.
"use strict";
(() => {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const options = { displaylogo: false, displayModeBar: false, responsive: true };
  function draw(place) {
    const told = JSON.parse(place.querySelector("script").textContent), layout = told.layout;
    const line = dark.matches ? "#363d45" : "#e3e6ea";
    layout.font = { ...layout.font, color: dark.matches ? "#dde1e6" : "#23282d" };
    for (const name of Object.keys(layout).filter((key) => /^[xy]axis\d*$/.test(key))) {
      layout[name] = { automargin: true, gridcolor: line, linecolor: line, zerolinecolor: line, ...layout[name] };
    }
    for (const name of ["xaxis", "yaxis"]) {
      if (!layout[name]) layout[name] = { automargin: true, gridcolor: line, linecolor: line, zerolinecolor: line };
    }
    Plotly.react(place.querySelector(".plot"), told.data, layout, options);
  }
  const all = () => document.querySelectorAll(".figure").forEach(draw);
  dark.addEventListener("change", all);
  all();
})();
