const RATE = 8_000;

/** A tone of 440 Hz as the address of a WAV file of 16 bits. */
export function tone(seconds: number): string {
  const samples = Math.round(RATE * seconds);
  const view = new DataView(new ArrayBuffer(44 + 2 * samples));
  const text = (at: number, value: string): void =>
    [...value].forEach((letter, k) => view.setUint8(at + k, letter.charCodeAt(0)));
  text(0, 'RIFF');
  view.setUint32(4, 36 + 2 * samples, true);
  text(8, 'WAVEfmt ');
  view.setUint32(16, 16, true);
  view.setUint16(20, 1, true);
  view.setUint16(22, 1, true);
  view.setUint32(24, RATE, true);
  view.setUint32(28, 2 * RATE, true);
  view.setUint16(32, 2, true);
  view.setUint16(34, 16, true);
  text(36, 'data');
  view.setUint32(40, 2 * samples, true);
  for (let i = 0; i < samples; i++) view.setInt16(44 + 2 * i, 3_000 * Math.sin((2 * Math.PI * 440 * i) / RATE), true);
  return URL.createObjectURL(new Blob([view], { type: 'audio/wav' }));
}
