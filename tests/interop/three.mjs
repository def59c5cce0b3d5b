// Print the positions of joints in a BVH file as three.js plays it: node three.mjs PACKAGES FILE FRAMES
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [packages, file, frames] = process.argv.slice(2);
const from = (path) => import(pathToFileURL(`${packages}/node_modules/three/${path}`));
const { AnimationMixer, LoopOnce, Vector3 } = await from("build/three.module.js");
const { BVHLoader } = await from("examples/jsm/loaders/BVHLoader.js");

const text = readFileSync(file, "utf8");
const { skeleton, clip } = new BVHLoader().parse(text);
const root = skeleton.bones[0];
const mixer = new AnimationMixer(root);
const action = mixer.clipAction(clip).setLoop(LoopOnce);
action.clampWhenFinished = true;
action.play();
const joints = skeleton.bones.filter((bone) => bone.name !== "ENDSITE");
const positions = [];
for (let frame = 0; frame < Number(frames); frame++) {
  mixer.setTime(clip.tracks[0].times[frame]);
  root.updateMatrixWorld(true);
  positions.push(joints.map((bone) => new Vector3().setFromMatrixPosition(bone.matrixWorld).toArray()));
}
console.log(JSON.stringify({ names: joints.map((bone) => bone.name), positions }));
