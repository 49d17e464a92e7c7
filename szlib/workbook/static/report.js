// Makes a report convenient.
(() => {
  // Opens the notebook that holds the target of a link.
  const reveal = (hash) => {
    const fold = document.getElementById(decodeURIComponent(hash.slice(1)))?.closest("details");
    if (fold) fold.open = true;
  };
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
