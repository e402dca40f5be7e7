// Draws each figure of the page in the colors of light or dark, anew when the reader changes between them; narrow pages break long labels.
"use strict";
(() => {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const options = { displaylogo: false, displayModeBar: false, responsive: true };
  const narrow = window.matchMedia("(max-width: 560px)");
  const LABEL = 14, TITLE = 28; // characters of a line where the page is narrow: of a tick, of an axis's title

  // Breaks a text into lines at its spaces. What stands in it is escaped already; a break is the only tag of ours.
  function broken(text, width) {
    const lines = [""];
    for (const word of String(text).split(" ")) {
      const last = lines[lines.length - 1];
      if (last && last.length + word.length >= width) lines.push(word);
      else lines[lines.length - 1] = last ? `${last} ${word}` : word;
    }
    return lines.join("<br>");
  }

  // Titles of axes and long labels of rows are broken, which a phone would clip, or leave no room beside.
  function fold(told) {
    for (const name of Object.keys(told.layout).filter((key) => /^[xy]axis\d*$/.test(key))) {
      const { title } = told.layout[name];
      if (title) told.layout[name].title = { ...title, text: broken(title.text, TITLE), font: { size: 12 } };
    }
    for (const trace of told.data) {
      if (Array.isArray(trace.y) && trace.y.some((value) => typeof value === "string")) {
        trace.y = trace.y.map((value) => (typeof value === "string" ? broken(value, LABEL) : value));
      }
      if (Array.isArray(trace.x) && trace.x.some((value) => typeof value === "string")) {
        trace.x = trace.x.map((value) => (typeof value === "string" ? broken(value, LABEL) : value));
        const axis = (trace.xaxis || "x").replace("x", "xaxis");
        told.layout[axis] = { ...told.layout[axis], tickangle: -90 }; // a slanted label would leave the page
      }
    }
    if (told.layout.margin) told.layout.margin = { ...told.layout.margin, l: 45, r: 8 };
  }

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
    if (narrow.matches) fold(told);
    if (!window.Plotly) run(document.querySelector("script.plotly").textContent);
    Plotly.react(place.querySelector(".plot"), told.data, layout, options);
    place.drawn = true;
  }

  // Plotly takes half a second to start: it waits as text until the first figure is drawn. The page's policy knows its hash.
  function run(text) {
    const script = document.createElement("script");
    script.textContent = text;
    document.head.append(script);
  }
  const again = () => [...document.querySelectorAll(".figure")].filter((place) => place.drawn).forEach(draw);
  dark.addEventListener("change", again);
  narrow.addEventListener("change", again);
  later(document.querySelectorAll(".figure"), draw);
})();
