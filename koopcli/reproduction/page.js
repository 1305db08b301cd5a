// Each view stands beside a picture of the same, which stays where views cannot be drawn and comes back in print.
(() => {
  const canvas = document.createElement("canvas");
  if (!window.Plotly || !(canvas.getContext("webgl2") || canvas.getContext("webgl"))) return;
  for (const view of document.querySelectorAll(".view")) {
    const { data, layout } = JSON.parse(document.getElementById(`${view.id}-data`).textContent);
    const figure = view.closest("figure");
    figure.classList.add("turnable"); // shown first: what is hidden has no size to be drawn in
    Plotly.newPlot(view, data, layout, { responsive: true, displaylogo: false })
      .catch(() => figure.classList.remove("turnable"));
  }
})();
