// Each cloud of the page: what its points are painted with, which classes are shown, and how sure they have to be.
"use strict";

function unpacked(text, Kind) {
  return new Kind(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
}

function lengthInWords(meters) {
  if (meters < 0.01) return `${(1000 * meters).toFixed(1)} mm`;
  return meters < 1 ? `${(100 * meters).toFixed(meters < 0.1 ? 1 : 0)} cm` : `${meters.toFixed(1)} m`;
}

function setUpCloud(card) {
  const told = JSON.parse(card.querySelector("script").textContent);
  const place = unpacked(told.place, Uint16Array), photo = unpacked(told.color, Uint8Array);
  const segment = unpacked(told.segment, Uint8Array), level = unpacked(told.level, Uint8Array);
  const instance = unpacked(told.instance, Uint16Array);
  const plot = card.querySelector(".plot"), slider = card.querySelector("input[type=range]");
  const [finest, coarsest] = told.ends, top = told.levels.length - 2;
  const paints = {
    photo: (i) => [photo[3 * i], photo[3 * i + 1], photo[3 * i + 2]],
    class: (i) => told.classes[segment[i]] || [0, 0, 0],
    instance: (i) => told.instances[instance[i]],
    uncertainty: (i) => told.levels[level[i]],
  };

  function shown() {
    const limit = slider ? Number(slider.value) : top + 1;
    const wanted = new Set();
    for (const box of card.querySelectorAll("input[type=checkbox]:checked")) wanted.add(Number(box.value));
    const most = limit > top ? 255 : limit, rows = [];
    for (let i = 0; i < told.count; i += 1) if (wanted.has(segment[i]) && level[i] <= most) rows.push(i);
    return rows;
  }

  function traces() {
    const paint = card.querySelector("input[type=radio]:checked").value, rows = shown();
    const axis = (k) => rows.map((i) => told.low[k] + told.step[k] * place[3 * i + k]);
    const color = rows.map((i) => `rgb(${paints[paint](i).join(",")})`);
    for (const part of card.querySelectorAll("[data-paint]")) part.hidden = part.dataset.paint !== paint;
    card.querySelector("output.count").textContent =
      `${rows.length.toLocaleString("en")} points shown` + (told.every > 1 ? `, one of ${told.every}` : "");
    const points = { type: "scatter3d", mode: "markers", hoverinfo: "skip", marker: { size: 1.8, color } };
    [points.x, points.y, points.z] = [0, 1, 2].map(axis);
    const flight = { type: "scatter3d", mode: "lines+markers", name: "cameras", hoverinfo: "skip",
      marker: { size: 3, color: "#4a90d9" }, line: { color: "#4a90d9", width: 1 } };
    [flight.x, flight.y, flight.z] = [0, 1, 2].map((k) => told.cameras.map((camera) => camera[k]));
    return [points, flight];
  }

  const plain = { showbackground: false, title: { text: "" }, showticklabels: false, showspikes: false };
  const [x, y, z] = told.ranges.map((range) => ({ ...plain, range }));
  const spans = told.ranges.map(([low, high]) => high - low), widest = Math.max(...spans);
  const aspect = spans.map((span) => (1.5 * span) / widest);  // so that all of a long bridge is in the picture
  const layout = { autosize: true, margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, uirevision: "kept",
    paper_bgcolor: "rgba(0,0,0,0)", scene: { aspectmode: "manual", aspectratio: { x: aspect[0], y: aspect[1], z: aspect[2] },
      camera: { eye: { x: 0.75, y: -1.15, z: 0.75 } }, xaxis: x, yaxis: y, zaxis: z, uirevision: "kept" } };
  const options = { displaylogo: false, displayModeBar: false, responsive: true };
  const sayLimit = () => {
    const limit = finest * Math.pow(coarsest / finest, slider.value / top);
    card.querySelector("output.limit").textContent = slider.value > top ? "any" : lengthInWords(limit);
  };
  if (slider) slider.addEventListener("input", sayLimit);
  const draw = () => Plotly.react(plot, traces(), layout, options);
  draw();
  for (const control of card.querySelectorAll("input")) control.addEventListener("change", draw);
  for (const button of card.querySelectorAll("button")) {
    button.addEventListener("click", () => {
      for (const box of card.querySelectorAll("input[type=checkbox]")) box.checked = button.value === "all";
      draw();
    });
  }
}

for (const card of document.querySelectorAll(".cloud")) setUpCloud(card);

// The other figures follow the light or dark of the page.
const dark = window.matchMedia("(prefers-color-scheme: dark)");
function ink() {
  const color = dark.matches ? "#d7dbe0" : "#2b2f33", line = dark.matches ? "#3a4149" : "#e2e5e9";
  for (const plot of document.querySelectorAll(".js-plotly-plot")) {
    const change = { "font.color": color };
    for (const axis of ["xaxis", "yaxis", "xaxis2", "yaxis2"]) {
      if (plot.layout[axis]) Object.assign(change, { [`${axis}.gridcolor`]: line, [`${axis}.linecolor`]: line, [`${axis}.zerolinecolor`]: line });
    }
    Plotly.relayout(plot, change);
  }
}
dark.addEventListener("change", ink);
if (dark.matches) ink();
