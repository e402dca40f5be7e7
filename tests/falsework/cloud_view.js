// Works every control of the first card, then says what it held after each, and what its canvas showed.
dispatchEvent(new Event("beforeprint"));  // draws what is out of sight, too
const card = document.querySelector(".card.space"), space = card.space, told = { drawn: {} };
const change = (control, name = "change") => control.dispatchEvent(new Event(name));
const box = (name) => card.querySelector(`input[name=${name}]`);
box("cameras").checked = false;
box("size").value = 3;
const wait = async (done) => { while (!done()) await new Promise((go) => setTimeout(go, 20)); };

// Points that nothing hides: they alone are picked at their middle and around it, where edges are smoothed.
const { gl } = space.pen;
const picture = (picking) => {
  space.draw(picking);
  const bytes = new Uint8Array(4 * space.canvas.width * space.canvas.height);
  gl.readPixels(0, 0, space.canvas.width, space.canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  return ([x, y]) => [...bytes.subarray(4 * (x + y * space.canvas.width), 4 * (x + y * space.canvas.width) + 3)];
};
space.eye.look("elevation");
space.draw();
const ids = picture(true), around = [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]], front = [];
for (let i = 0; i < space.told.count; i += 1) {
  const [x, y] = space.pixel(space.at(i)), own = [(i + 1) & 255, (i + 1) >> 8, 0].join();
  if (around.every(([dx, dy]) => ids([x + dx, y + dy]).join() === own)) front.push([i, [x, y]]);
}
told.pickedAlone = front.slice(0, 5).every(([i, at]) => space.pick(at, 0) === i);
for (const radio of card.querySelectorAll("input[type=radio]")) {
  radio.checked = true;
  change(radio);
  told[radio.value] = Array.from({ length: space.told.count }, (_, i) => [...space.colors.subarray(3 * i, 3 * i + 3)]);
  const shown = picture(false);
  told.drawn[radio.value] = front.map(([i, at]) => [i, shown(at)]);
}
told.scale = !card.querySelector(".scale").hidden;
told.slid = [255, 254, 200, 100, 0].map((value) => {
  space.slider.value = value;
  change(space.slider, "input");
  return space.rows.length;
});
space.slider.value = 255;
change(space.slider, "input");
card.querySelector("button[value=none]").click();
told.none = space.rows.length;
told.classes = [...card.querySelectorAll("input[name=class]")].map((one) => {
  one.checked = true;
  change(one);
  const count = space.rows.length;
  one.checked = false;
  change(one);
  return [Number(one.value), count];
});
card.querySelector("button[value=all]").click();
told.all = space.rows.length;

// A click on a point, as a mouse makes it.
const ratio = space.canvas.width / space.canvas.clientWidth, place = space.canvas.getBoundingClientRect();
const click = ([x, y]) => {
  const at = { pointerId: 1, clientX: place.left + (x + 0.5) / ratio, clientY: place.bottom - (y + 0.5) / ratio, bubbles: true };
  space.canvas.setPointerCapture = () => {};
  space.canvas.dispatchEvent(new PointerEvent("pointerdown", at));
  space.canvas.dispatchEvent(new PointerEvent("pointerup", at));
};
const [chosen, where] = front[10];
told.picked = chosen;
click(where);
told.words = card.querySelector(".picked").textContent;
told.rays = space.rays.count;

// From above, the pictures stand in their frusta.
card.querySelector("button[value=none]").click();
space.tell(-1);
box("pictures").checked = true;
await wait(() => space.sheet);
card.querySelector("button[data-look=plan]").click();
const middles = space.told.flight.cameras.map((camera) => space.pixel([camera.eye[0], camera.eye[1], camera.eye[2] - space.told.flight.depth]));
told.pictures = middles.map(picture(false));
click(middles[1]);
told.image = card.querySelector(".picked a").textContent;
return told;
