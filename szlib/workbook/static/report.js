// Replaces the picture of each finished run in a report by its player; `runs` holds the data of players by name.
function playAll(runs) {
  for (const figure of document.querySelectorAll("figure.szlib-player")) {
    try {
      if (Object.hasOwn(runs, figure.dataset.run)) play(figure, runs[figure.dataset.run]);
    } catch (error) {
      console.error(error);  // the data of another program; the other players go on
    }
  }
}
