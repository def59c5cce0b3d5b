// Print the positions of joints in a BVH file as Babylon.js plays it: node babylon.mjs PACKAGES FILE FRAMES
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [packages, file, frames] = process.argv.slice(2);
const from = (path) => import(pathToFileURL(`${packages}/node_modules/@babylonjs/${path}`));
const { NullEngine } = await from("core/Engines/nullEngine.js");
const { Scene } = await from("core/scene.js");
const { ReadBvh } = await from("loaders/BVH/bvhLoader.js");

const skeleton = ReadBvh(readFileSync(file, "utf8"), new Scene(new NullEngine()), null, { loopMode: 1 });
const joints = skeleton.bones.filter((bone) => bone.name !== "ENDSITE");
const positions = [];
for (let frame = 0; frame < Number(frames); frame++) {
  for (const bone of skeleton.bones) {
    for (const animation of bone.animations) {
      bone[animation.targetProperty] = animation.evaluate(frame);
    }
  }
  skeleton.computeAbsoluteMatrices(true);
  positions.push(joints.map((bone) => bone.getAbsoluteMatrix().getTranslation().asArray()));
}
console.log(JSON.stringify({ names: joints.map((bone) => bone.name), positions }));
