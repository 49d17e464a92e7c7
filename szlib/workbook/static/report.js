// Makes a report convenient.
(() => {
  // Opens the notebook that holds the target of a link.
  const reveal = (hash) => {
    const fold = document.getElementById(decodeURIComponent(hash.slice(1)))?.closest("details");
    if (fold) fold.open = true;
  };
  // Shows the first player of each scenario in the answer, too: its script plays every figure that is new.
  const shown = document.querySelector(".players");
  for (const [title, name] of Object.entries(JSON.parse(shown.dataset.scenarios))) {
    const canvas = [...document.querySelectorAll("figure.szlib-player canvas")].find((each) => each.ariaLabel?.startsWith(`${title}:`));
    if (!canvas) continue;
    shown.parentElement.hidden = false;
    const found = canvas.closest("figure"), script = document.createElement("script"), place = document.createElement("div");
    const figure = Object.assign(document.createElement("figure"), { className: found.className });
    figure.dataset.run = found.dataset.run;
    const text = name.replaceAll("_", " ");
    place.append(Object.assign(document.createElement("p"), { textContent: text[0].toUpperCase() + text.slice(1) }), figure);
    shown.append(place);
    script.textContent = found.nextElementSibling.textContent;
    place.append(script);
  }
  // Aligns columns of numbers, with their headers, to the right.
  for (const table of document.querySelectorAll("table")) {
    const rows = [...table.tBodies].flatMap((body) => [...body.rows]).map((row) => [...row.cells]);
    const width = Math.max(0, ...rows.map((row) => row.length)), heads = [...(table.tHead?.rows ?? [])];
    for (let i = 1; i <= width; i++) {  // from the right: a first cell may belong to several rows
      const column = rows.map((row) => row.at(-i)).filter(Boolean), texts = column.map((cell) => cell.textContent.trim());
      if (!texts.every((text) => /^([-+\u2212]?\d[\d,.]*(e[-+]?\d+)?( ?%)?|nan|inf|)$/i.test(text)) || !texts.some(Boolean)) continue;
      const titles = heads.map((row) => [...row.cells]).filter((row) => row.length === width).map((row) => row.at(-i));
      for (const cell of [...column, ...titles]) cell.classList.add("number");
    }
  }
  addEventListener("hashchange", () => reveal(location.hash));
  addEventListener("click", (event) => {
    const link = event.target.closest('a[href^="#"]');
    if (!link) return;
    link.closest(".menu")?.removeAttribute("open");
    reveal(link.hash);
  });
  reveal(location.hash);
})();
