// The waveform: a canvas that is drawn when speech, size or colours change.

/** Draw `peaks`, 0 to 1 each, over the whole width of the canvas in the colour that the style sheet gives it. */
export function drawWaveform(canvas: HTMLCanvasElement, peaks: number[]): void {
  const scale = Math.min(window.devicePixelRatio, 2);
  const width = Math.round(canvas.clientWidth * scale);
  const height = Math.round(canvas.clientHeight * scale);
  if (!width || !height) return;
  canvas.width = Math.min(width, 16_000); // browsers draw nothing into wider ones
  canvas.height = height;
  const context = canvas.getContext("2d");
  if (context === null || !peaks.length) return;
  context.fillStyle = getComputedStyle(canvas).color;
  const top = Math.max(...peaks, 0.05);
  const step = 3 * scale;
  for (let x = 0; x < canvas.width; x += step) {
    const from = Math.floor((x / canvas.width) * peaks.length);
    const to = Math.max(Math.ceil(((x + step) / canvas.width) * peaks.length), from + 1);
    const bar = Math.max((Math.max(...peaks.slice(from, to), 0) / top) * height * 0.94, scale);
    context.beginPath();
    context.roundRect(x, (height - bar) / 2, 2 * scale, bar, scale);
    context.fill();
  }
}
