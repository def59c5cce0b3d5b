// Play files of characters in a browser: window.players[program](url, task) returns positions of nodes and a picture.
// A task has animation (a number, or null), times, nodes, and for a picture camera {centre, half, back} and size.
import {
  AnimationMixer, Color, DirectionalLight, HemisphereLight, LoopOnce, OrthographicCamera, Scene, Vector3, WebGLRenderer,
} from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { VRMLoaderPlugin } from "@pixiv/three-vrm";
import { VRMAnimationLoaderPlugin, createVRMAnimationClip } from "@pixiv/three-vrm-animation";
import { Engine } from "@babylonjs/core/Engines/engine.js";
import { Scene as BabylonScene } from "@babylonjs/core/scene.js";
import { FreeCamera } from "@babylonjs/core/Cameras/freeCamera.js";
import { HemisphericLight } from "@babylonjs/core/Lights/hemisphericLight.js";
import { Color4 } from "@babylonjs/core/Maths/math.color.js";
import { Vector3 as BabylonVector } from "@babylonjs/core/Maths/math.vector.js";
import { LoadAssetContainerAsync } from "@babylonjs/core/Loading/sceneLoader.js";
import "@babylonjs/loaders/glTF/2.0/index.js";

const SIDE = 3; // of the camera: x, y and z [half heights of the picture]

function eye({ centre, half, back }) {
  const [x, y, z] = [0.5 * SIDE * half, 0.25 * SIDE * half, SIDE * half];
  return back ? [centre[0] - x, centre[1] + y, centre[2] - z] : [centre[0] + x, centre[1] + y, centre[2] + z];
}

function threePicture(root, { camera, size }) {
  const renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  renderer.setSize(size, size);
  const scene = new Scene();
  scene.background = new Color(0xffffff);
  const sun = new DirectionalLight(0xffffff, 1.5);
  sun.position.set(...eye(camera));
  scene.add(root, new HemisphereLight(0xffffff, 0x888888, 1), sun);
  const { half } = camera;
  const view = new OrthographicCamera(-half, half, half, -half, 0.001 * half, 20 * half);
  view.position.set(...eye(camera));
  view.lookAt(new Vector3(...camera.centre));
  renderer.render(scene, view);
  const picture = renderer.domElement.toDataURL("image/png");
  renderer.dispose();
  return picture;
}

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
  const positions = task.times.map((time) => {
    mixer.setTime(time);
    update();
    root.updateMatrixWorld(true);
    return task.nodes.map((node) => {
      const object = objects.get(node);
      return object ? new Vector3().setFromMatrixPosition(object.matrixWorld).toArray() : null;
    });
  });
  return { positions, picture: task.camera && threePicture(root, task) };
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
  canvas.width = canvas.height = task.size ?? 16;
  const engine = new Engine(canvas, true, { preserveDrawingBuffer: true });
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
  let picture;
  if (task.camera) {
    const { half, centre } = task.camera;
    scene.clearColor = new Color4(1, 1, 1, 1);
    const view = new FreeCamera("view", new BabylonVector(...eye(task.camera)), scene);
    view.mode = 1;
    [view.orthoLeft, view.orthoRight, view.orthoBottom, view.orthoTop] = [-half, half, -half, half];
    [view.minZ, view.maxZ] = [0.001 * half, 20 * half];
    view.setTarget(new BabylonVector(...centre));
    new HemisphericLight("light", new BabylonVector(...eye(task.camera)), scene).intensity = 1;
    await scene.whenReadyAsync();
    scene.render();
    picture = canvas.toDataURL("image/png");
  }
  engine.dispose();
  return { positions, picture };
}

window.players = { "three.js": three, "three-vrm": threeVrm, "Babylon.js": babylon };
