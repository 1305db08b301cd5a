// Everything can be read without a script: this adds buttons that copy, pictures that enlarge, and tables that are open
// in print where the style sheet cannot open them.
(() => {
  const copy = async code => {
    try {
      await navigator.clipboard.writeText(code.textContent);
    } catch { // an old browser, or a page that is no secure one
      getSelection().selectAllChildren(code);
      document.execCommand("copy");
    }
  };
  for (const line of document.querySelectorAll(".command")) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = "Copy";
    button.onclick = async () => {
      await copy(line.querySelector("code"));
      button.textContent = "Copied";
      setTimeout(() => { button.textContent = "Copy"; }, 1500);
    };
    line.append(button);
  }

  const dialog = document.createElement("dialog");
  dialog.setAttribute("aria-label", "figure, enlarged");
  dialog.onclick = () => dialog.close();
  document.body.append(dialog);
  for (const image of document.querySelectorAll("figure img")) {
    image.tabIndex = 0;
    image.setAttribute("role", "button");
    image.title = "Enlarge";
    image.onclick = () => {
      const large = image.cloneNode();
      large.removeAttribute("title");
      large.removeAttribute("tabindex");
      dialog.replaceChildren(large);
      dialog.showModal();
    };
    image.onkeydown = event => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      image.onclick();
    };
  }

  const opened = [];
  addEventListener("beforeprint", () => {
    for (const one of document.querySelectorAll(".folded:not([open])")) {
      one.open = true;
      opened.push(one);
    }
  });
  addEventListener("afterprint", () => {
    for (const one of opened.splice(0)) one.open = false;
  });
})();
