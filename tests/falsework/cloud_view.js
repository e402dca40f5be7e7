// Works every control of the report's first cloud, then says what the plot held after each.
(async () => {
  const card = document.querySelector(".cloud"), plot = card.querySelector(".plot"), told = {};
  const colors = () => plot.data[0].marker.color;
  const change = (control) => control.dispatchEvent(new Event("change"));
  for (const radio of card.querySelectorAll("input[type=radio]")) {
    radio.checked = true;
    change(radio);
    told[radio.value] = [...colors()];
  }
  told.scale = !card.querySelector(".scale").hidden;
  told.x = [...plot.data[0].x];
  const slider = card.querySelector("input[type=range]");
  told.slid = [255, 254, 200, 100, 0].map((value) => {
    slider.value = value;
    change(slider);
    return colors().length;
  });
  slider.value = 255;
  change(slider);
  card.querySelector("button[value=none]").click();
  told.none = colors().length;
  told.classes = [...card.querySelectorAll("input[type=checkbox]")].map((box) => {
    box.checked = true;
    change(box);
    const count = colors().length;
    box.checked = false;
    change(box);
    return [Number(box.value), count];
  });
  card.querySelector("button[value=all]").click();
  told.all = colors().length;
  const picture = new Image();
  picture.src = await Plotly.toImage(plot, { format: "png", width: 300, height: 200 });
  await picture.decode();
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [300, 200];
  const pen = canvas.getContext("2d");
  pen.drawImage(picture, 0, 0);
  told.drawn = new Set(new Uint32Array(pen.getImageData(0, 0, 300, 200).data.buffer)).size;
  told.mistakes = window.mistakes;
  return told;
})().catch((mistake) => ({ mistakes: [String(mistake)] })).then((told) => {
  document.body.textContent = "found in the page" + JSON.stringify(told) + "found in the page";
});
