// Perceptually even maps, safe for colour-blind readers: inferno (van der Walt and Smith 2015), and Moreland's cool to
// warm for differences (2009). Given by a few of their colours, blended between.
export type Table = Uint8ClampedArray; // 256 x 3

type Stop = [number, number, number];
const kInferno: Stop[] = [
  [0, 0, 4], [11, 7, 36], [32, 12, 74], [60, 9, 101], [87, 16, 110], [114, 25, 110], [140, 41, 99],
  [168, 46, 95], [187, 55, 84], [212, 72, 66], [227, 89, 51], [243, 120, 25], [249, 142, 9], [252, 173, 18],
  [249, 201, 50], [241, 233, 105], [252, 255, 164],
];
const kCoolWarm: Stop[] = [
  [59, 76, 192], [98, 130, 234], [141, 176, 254], [184, 208, 249], [221, 221, 221], [245, 196, 173],
  [244, 154, 123], [222, 96, 77], [180, 4, 38],
];
const kGrey: Stop[] = [[0, 0, 0], [255, 255, 255]];

function blended(stops: Stop[]): Table {
  const table = new Uint8ClampedArray(768);
  for (let i = 0; i < 256; ++i) {
    const at = (i / 255) * (stops.length - 1);
    const low = Math.min(Math.floor(at), stops.length - 2);
    for (let c = 0; c < 3; ++c) table[3 * i + c] = stops[low][c] + (at - low) * (stops[low + 1][c] - stops[low][c]);
  }
  return table;
}

export const maps = { inferno: blended(kInferno), grey: blended(kGrey), difference: blended(kCoolWarm) };
export type MapName = keyof typeof maps;

// The map as the words that a colour image needs, little-endian ABGR.
const packedCache = new Map<Table, Uint32Array>();
export function packed(table: Table): Uint32Array {
  let words = packedCache.get(table);
  if (!words) {
    words = new Uint32Array(256);
    for (let i = 0; i < 256; ++i)
      words[i] = (255 << 24) | (table[3 * i + 2] << 16) | (table[3 * i + 1] << 8) | table[3 * i];
    packedCache.set(table, words);
  }
  return words;
}
