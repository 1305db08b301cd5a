// Each view stands beside a picture of the same, which stays where views cannot be drawn and comes back in print.
const NARROW = 600; // pixels
(() => {
  const canvas = document.createElement("canvas");
  if (!window.Plotly || !(canvas.getContext("webgl2") || canvas.getContext("webgl"))) return;
  for (const view of document.querySelectorAll(".view")) {
    const { data, layout } = JSON.parse(document.getElementById(`${view.id}-data`).textContent);
    const figure = view.closest("figure");
    figure.classList.add("turnable"); // shown first: what is hidden has no size to be drawn in
    if (view.clientWidth < NARROW) { // the bar goes below, the eye further away
      const { colorbar } = data[data.length - 1].marker;
      Object.assign(colorbar, { orientation: "h", len: 0.9, y: -0.02, yanchor: "top" });
      colorbar.title.side = "bottom";
      const { eye } = layout.scene.camera;
      for (const axis of ["x", "y", "z"]) eye[axis] *= 1.45;
      layout.legend.y = -0.3;
    }
    Plotly.newPlot(view, data, layout, {
      responsive: true,
      displaylogo: false,
      plotlyServerURL: "", // nothing here leaves the page
      modeBarButtons: [["zoom3d", "pan3d", "orbitRotation", "resetCameraDefault3d", "toImage"]],
    })
      .catch(() => figure.classList.remove("turnable"));
  }
})();
