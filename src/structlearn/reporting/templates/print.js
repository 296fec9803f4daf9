// On paper nothing can be opened: folded parts are printed, and pictures that were not scrolled to.
let opened = [];
addEventListener("beforeprint", () => {
  opened = [...document.querySelectorAll("details:not([open])")];
  for (const part of opened) part.open = true;
  for (const picture of document.querySelectorAll("img[loading]")) picture.loading = "eager";
});
addEventListener("afterprint", () => {
  for (const part of opened) part.open = false;
});
