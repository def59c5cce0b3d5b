// Play files of characters in a browser: window.players[program](url, task) returns positions of nodes.
// A task has animation (a number, or null), times and nodes.
import { AnimationMixer, LoopOnce, Vector3 } from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { VRMLoaderPlugin } from "@pixiv/three-vrm";
import { VRMAnimationLoaderPlugin, createVRMAnimationClip } from "@pixiv/three-vrm-animation";
import { Engine } from "@babylonjs/core/Engines/engine.js";
import { Scene as BabylonScene } from "@babylonjs/core/scene.js";
import { LoadAssetContainerAsync } from "@babylonjs/core/Loading/sceneLoader.js";
import "@babylonjs/loaders/glTF/2.0/index.js";

/** Play a clip on a root that a loader has made; `update` runs after each frame. */
function threePlayed(gltf, root, clip, task, update = () => {}) {
  const mixer = new AnimationMixer(root);
  if (clip) {
    const action = mixer.clipAction(clip).setLoop(LoopOnce);
    action.clampWhenFinished = true;
    action.play();
  }
  const objects = new Map();
  root.traverse((object) => {
    const node = gltf.parser.associations.get(object)?.nodes;
    if (node !== undefined && !objects.has(node)) {
      objects.set(node, object);
    }
  });
  return task.times.map((time) => {
    mixer.setTime(time);
    update();
    root.updateMatrixWorld(true);
    return task.nodes.map((node) => {
      const object = objects.get(node);
      return object ? new Vector3().setFromMatrixPosition(object.matrixWorld).toArray() : null;
    });
  });
}

async function three(url, task) {
  const gltf = await new GLTFLoader().loadAsync(url);
  return threePlayed(gltf, gltf.scene, gltf.animations[task.animation], task);
}

/** An animation in the VRM file itself moves its own nodes; one in a VRM animation file, task.vrma, the humanoid. */
async function threeVrm(url, task) {
  const loader = new GLTFLoader();
  loader.register((parser) => new VRMLoaderPlugin(parser));
  loader.register((parser) => new VRMAnimationLoaderPlugin(parser));
  const gltf = await loader.loadAsync(url);
  const { vrm } = gltf.userData;
  if (!vrm) {
    throw new Error("three-vrm finds no VRM in the file");
  }
  if (!task.vrma) {
    vrm.humanoid.autoUpdateHumanBones = false;
    return threePlayed(gltf, vrm.scene, gltf.animations[task.animation], task, () => vrm.update(0));
  }
  const moving = (await loader.loadAsync(task.vrma)).userData.vrmAnimations;
  if (!moving?.length) {
    throw new Error("three-vrm finds no VRM animation in the file");
  }
  const clip = createVRMAnimationClip(moving[task.animation ?? 0], vrm);
  return threePlayed(gltf, vrm.scene, clip, task, () => vrm.update(0));
}

async function babylon(url, task) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 16;
  const engine = new Engine(canvas);
  const scene = new BabylonScene(engine);
  scene.useRightHandedSystem = true;
  const ending = url.slice(url.lastIndexOf("."));
  const container = await LoadAssetContainerAsync(url, scene, {
    pluginExtension: ending === ".gltf" ? ".gltf" : ".glb",
  });
  container.addAllToScene();
  container.animationGroups.forEach((group) => group.stop());
  const nodes = new Map();
  for (const node of [...container.transformNodes, ...container.meshes]) {
    const pointers = node._internalMetadata?.gltf?.pointers ?? node.metadata?.gltf?.pointers ?? [];
    for (const pointer of pointers) {
      if (pointer.startsWith("/nodes/")) {
        nodes.set(Number(pointer.slice(7)), node);
      }
    }
  }
  const group = task.animation === null ? null : container.animationGroups[task.animation];
  if (group) {
    group.start(false);
    group.pause();
  }
  const positions = task.times.map((time) => {
    if (group) {
      group.goToFrame(time * group.targetedAnimations[0].animation.framePerSecond);
    }
    [...nodes.values()].forEach((node) => node.computeWorldMatrix(true));
    return task.nodes.map((node) => {
      let above = nodes.get(node);
      if (!above) {
        return null;
      }
      const line = [];
      for (; above; above = above.parent) {
        line.unshift(above);
      }
      line.forEach((one) => one.computeWorldMatrix(true));
      return line.at(-1).getWorldMatrix().getTranslation().asArray();
    });
  });
  engine.dispose();
  return positions;
}

window.players = { "three.js": three, "three-vrm": threeVrm, "Babylon.js": babylon };
