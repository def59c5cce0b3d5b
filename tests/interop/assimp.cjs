// Print the positions of joints in a BVH file as assimp reads it: node assimp.cjs PACKAGES FILE FRAMES
const { readFileSync } = require("node:fs");
const [packages, file, frames] = process.argv.slice(2);

// Matrices are row by row, for columns of coordinates.
const product = (a, b) =>
  a.map((_, i) => [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * Math.floor(i / 4) + k] * b[4 * k + (i % 4)], 0));

function matrix([w, x, y, z], [px, py, pz]) {
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), px,
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), py,
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), pz,
    0, 0, 0, 1,
  ];
}

require(`${packages}/node_modules/assimpjs`)().then((assimp) => {
  const files = new assimp.FileList();
  files.AddFile("clip.bvh", readFileSync(file));
  const result = assimp.ConvertFileList(files, "assjson");
  if (!result.IsSuccess()) {
    throw new Error(result.GetErrorCode());
  }
  const scene = JSON.parse(new TextDecoder().decode(result.GetFile(0).GetContent()));
  const channels = Object.fromEntries(scene.animations[0].channels.map((channel) => [channel.name, channel]));
  const names = [];
  const positions = Array.from({ length: Number(frames) }, () => []);
  const visit = (node, above) => {
    const channel = channels[node.name];
    const isJoint = channel !== undefined && !node.name.startsWith("EndSite_");
    const worlds = above.map((world, frame) => {
      const key = (keys) => keys[Math.min(frame, keys.length - 1)][1];
      const local = channel ? matrix(key(channel.rotationkeys), key(channel.positionkeys)) : node.transformation;
      return product(world, local);
    });
    if (isJoint) {
      names.push(node.name);
      worlds.forEach((world, frame) => positions[frame].push([world[3], world[7], world[11]]));
    }
    (node.children ?? []).forEach((child) => visit(child, worlds));
  };
  const identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  visit(scene.rootnode, positions.map(() => identity));
  console.log(JSON.stringify({ names, positions }));
});
