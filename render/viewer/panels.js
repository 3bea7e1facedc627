// Pictures on their canvases.

export function showImage(name, image) {
  const panel = document.getElementById(`${name}-panel`);
  if (!image) return;
  panel.classList.add("has-image");
  const canvas = document.getElementById(name);
  if (canvas.width !== image.width || canvas.height !== image.height) {
    canvas.width = image.width;
    canvas.height = image.height;
  }
  canvas.getContext("2d").drawImage(image, 0, 0);
}
