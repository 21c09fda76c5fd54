// The waveform: a canvas as wide as the view, drawn again when the view, the scale or the colours change.

const BAR = 3; // pixels from one bar to the next

/**
 * Draw the bars of `peaks`, 0 to 1 each, that are in view, in the colour that the style sheet gives the canvas.
 *
 * `width`: pixels of all of them; `left`: pixels before the view; `top`: the largest of them. Bars keep their places while
 * the view moves.
 */
export function drawWaveform(canvas: HTMLCanvasElement, peaks: number[], { width, left, top }: { width: number; left: number; top: number }): void {
  const scale = Math.min(window.devicePixelRatio, 2);
  const height = Math.round(canvas.clientHeight * scale);
  if (!canvas.clientWidth || !height) return;
  canvas.width = Math.round(canvas.clientWidth * scale);
  canvas.height = height;
  const context = canvas.getContext("2d");
  if (context === null || !peaks.length) return;
  context.fillStyle = getComputedStyle(canvas).color;
  for (let x = Math.floor(left / BAR) * BAR; x < Math.min(left + canvas.clientWidth, width); x += BAR) {
    const from = Math.floor((x / width) * peaks.length);
    const to = Math.max(Math.ceil(((x + BAR) / width) * peaks.length), from + 1);
    const bar = Math.max((Math.max(...peaks.slice(from, to), 0) / top) * height * 0.94, scale);
    context.beginPath();
    context.roundRect((x - left) * scale, (height - bar) / 2, 2 * scale, bar, scale);
    context.fill();
  }
}
