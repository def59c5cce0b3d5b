// A film: frames that the browser encodes as VP8, in a WebM file.

import {total} from './dom.js';

const KEY = 60; // frames from one key frame to the next
const DETAIL = 0.15; // bits for each pixel
const QUEUE = 4; // most frames that wait for the encoder

const bytesOf = (number, size) => (
  Uint8Array.from({length: size}, (_, k) => Math.floor(number / 256 ** (size - 1 - k)) % 256));
const text = string => new TextEncoder().encode(string);

/** An element of Matroska, by its number; its content is whole numbers, bytes and elements. */
function part(id, ...content) {
  const inside = content.flat().map(one => (typeof one === 'number' ? bytesOf(one, 6) : one));
  const size = total(inside, ({length}) => length);
  return [bytesOf(id, Math.ceil(Math.log2(id) / 8)), bytesOf(1, 1), bytesOf(size, 7), ...inside];
}

/** A WebM file of encoded frames: their data, times [ms], and whether each is a `key` frame, which begins a cluster. */
function webm(frames, width, height, duration) {
  const length = new Uint8Array(8), clusters = [];
  new DataView(length.buffer).setFloat64(0, duration);
  for (const {data, time, key} of frames) {
    if (key) clusters.push({time, blocks: []});
    const {time: start, blocks} = clusters.at(-1);
    blocks.push(part(0xa3, bytesOf(0x81, 1), bytesOf(time - start, 2), bytesOf(key ? 0x80 : 0, 1), data));
  }
  const track = part(0xae, part(0xd7, 1), part(0x73c5, 1), part(0x83, 1), part(0x86, text('V_VP8')),
    part(0xe0, part(0xb0, width), part(0xba, height)));
  return new Blob([part(0x1a45dfa3, part(0x4282, text('webm')), part(0x4287, 4), part(0x4285, 2)), part(0x18538067,
    part(0x1549a966, part(0x2ad7b1, 1e6), part(0x4489, length), part(0x4d80, text('distretarget')),
      part(0x5741, text('distretarget'))), part(0x1654ae6b, track),
    ...clusters.map(({time, blocks}) => part(0x1f43b675, part(0xe7, time), ...blocks)))].flat(), {type: 'video/webm'});
}

/** Films a canvas: `draw(k)` draws the k-th of `count` frames on it, and returns false to stop. */
export async function filmOf(canvas, count, frameTime, draw) {
  const frames = [];
  let fault = null, box = null;
  const encoder = new VideoEncoder({error: error => { fault = error; }, output: chunk => {
    const data = new Uint8Array(chunk.byteLength);
    chunk.copyTo(data);
    frames.push({data, time: Math.round(chunk.timestamp / 1000), key: chunk.type === 'key'});
  }});
  for (let k = 0; k < count && draw(k); k++) {
    if (!box) {
      box = {x: 0, y: 0, width: canvas.width & ~1, height: canvas.height & ~1};
      const bitrate = Math.round(DETAIL * box.width * box.height / frameTime);
      encoder.configure({codec: 'vp8', width: box.width, height: box.height, bitrate, framerate: 1 / frameTime});
    }
    const frame = new VideoFrame(canvas, {timestamp: Math.round(1e6 * frameTime * k), visibleRect: box});
    encoder.encode(frame, {keyFrame: k % KEY === 0});
    frame.close();
    do await new Promise(next => { setTimeout(next); }); while (encoder.encodeQueueSize > QUEUE && !fault);
    if (fault) throw fault;
  }
  await encoder.flush();
  encoder.close();
  return webm(frames, box.width, box.height, 1000 * frameTime * frames.length);
}
