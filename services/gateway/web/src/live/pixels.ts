// Drawing of grey images and slices with a colour map.
import { packed, type Table } from "../colour";

// `values` in [low, high] as colours; `rows` from the top. The canvas gets the image's own size; CSS scales it.
export function drawValues(canvas: HTMLCanvasElement, values: ArrayLike<number>, width: number, height: number, low: number, high: number, table: Table, full = Infinity): void {
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
  const context = canvas.getContext("2d");
  if (!context) return;
  const image = context.createImageData(width, height);
  const words = new Uint32Array(image.data.buffer);
  const colours = packed(table);
  const scale = high > low ? 255 / (high - low) : 0;
  for (let i = 0; i < words.length; ++i) {
    const value = values[i];
    const at = (value - low) * scale;
    words[i] = value >= full ? 0xffffd24d : colours[at <= 0 ? 0 : at >= 255 ? 255 : at | 0];
  }
  context.putImageData(image, 0, 0);
}
