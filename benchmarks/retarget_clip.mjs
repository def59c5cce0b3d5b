// Retarget a BVH clip with three.js's SkeletonUtils: node retarget_clip.mjs PACKAGES TASK.json RUNS
//
// The task: `bvh`, the text of the clip, and of the target in its bind pose, in which no bone is turned, `names`,
// `parents` and `offsets`; `pairs`, the source's bone of each of its bones; `hip`, the source's; `scale` of its path.
// Prints the tracks of the target's bones, and the seconds of processor time that each of the runs took.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [packages, file, runs] = process.argv.slice(2);
const from = (path) => import(pathToFileURL(`${packages}/node_modules/three/${path}`));
const { Bone, BufferGeometry, Skeleton, SkinnedMesh } = await from("build/three.module.js");
const { BVHLoader } = await from("examples/jsm/loaders/BVHLoader.js");
const { retargetClip } = await from("examples/jsm/utils/SkeletonUtils.js");

const task = JSON.parse(readFileSync(file, "utf8"));

function target() {
  const bones = task.names.map((name, joint) => {
    const bone = new Bone();
    bone.name = name;
    bone.position.fromArray(task.offsets[joint]);
    return bone;
  });
  const mesh = new SkinnedMesh(new BufferGeometry());
  bones.forEach((bone, joint) => (joint ? bones[task.parents[joint]] : mesh).add(bone));
  mesh.updateMatrixWorld(true);
  mesh.bind(new Skeleton(bones));
  return mesh;
}

const { skeleton, clip } = new BVHLoader().parse(task.bvh);
const body = target();
const seconds = [];
let made;
for (let run = 0; run < Number(runs); run++) {
  const started = process.cpuUsage();
  made = retargetClip(body, skeleton, clip, { hip: task.hip, names: { ...task.pairs }, scale: task.scale });
  const { user, system } = process.cpuUsage(started); // [us]
  seconds.push((user + system) / 1e6);
}
const tracks = made.tracks.map(({ name, values }) => {
  const [, bone, kind] = name.match(/^\.bones\[(.*)\]\.(\w+)$/);
  return { bone, kind, values: Array.from(values) };
});
console.log(JSON.stringify({ tracks, seconds }));
