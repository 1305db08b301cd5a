// The drawing shows where the cars end; a slider and a button move them.
(() => {
  const SLOWER = 4;
  const box = document.getElementById("ghosts");
  if (!box) return;
  const { dt, cars, off } = JSON.parse(box.querySelector("script").textContent);
  const shapes = [...box.querySelectorAll(".car")], said = [...box.querySelectorAll(".off")];
  const last = off[0].length - 1;
  const controls = document.createElement("p");
  controls.className = "controls";
  controls.innerHTML = `<button type="button">Play</button>
    <input type="range" min="0" max="${last}" value="${last}" aria-label="time"><output></output>`;
  box.querySelector("svg").after(controls);
  const [button, slider, time] = controls.children;
  const show = k => {
    slider.value = k;
    time.textContent = `${(k * dt).toFixed(2)} s`;
    for (const shape of shapes) {
      const [x, y, heading] = cars[shape.dataset.car].slice(3 * k, 3 * k + 3);
      shape.style.display = x === null ? "none" : "";
      if (x !== null) shape.setAttribute("transform", `translate(${x} ${-y}) rotate(${-heading * 180 / Math.PI})`);
    }
    said.forEach((text, i) => {
      const far = off[i + 1][k];
      text.textContent = far === null ? "lost" : `${far < 0.0005 ? 0 : far.toPrecision(3)} m off`;
    });
  };
  let running = 0;
  const stop = () => { cancelAnimationFrame(running); running = 0; button.textContent = "Play"; };
  slider.oninput = () => { stop(); show(+slider.value); };
  button.onclick = () => {
    if (running) return stop();
    const from = +slider.value < last ? +slider.value : 0;
    let start = null;
    button.textContent = "Pause";
    const step = now => {
      start ??= now;
      const k = Math.min(last, from + Math.floor((now - start) / 1000 / dt / SLOWER));
      show(k);
      if (k < last) running = requestAnimationFrame(step); else stop();
    };
    running = requestAnimationFrame(step);
  };
  time.textContent = `${(last * dt).toFixed(2)} s`;
})();
