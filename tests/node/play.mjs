// Plays the first animation of a GLB in three.js, and prints where the joints of each skinned mesh are at each time:
// node play.mjs FILE TIME...
import { readFile } from "node:fs/promises";
import { AnimationMixer, Vector3 } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const [path, ...times] = process.argv.slice(2);
const data = await readFile(path);
const bytes = data.buffer.slice(data.byteOffset, data.byteOffset + data.byteLength);
const { scene, animations } = await new GLTFLoader().parseAsync(bytes, "");
const mixer = new AnimationMixer(scene);
mixer.clipAction(animations[0]).play();
const said = [];
for (const time of times.map(Number)) {
  mixer.setTime(time);
  scene.updateMatrixWorld(true);
  const figures = [];
  scene.traverse((node) => {
    if (!node.isSkinnedMesh) return;
    const joints = node.skeleton.bones.map((bone) => bone.getWorldPosition(new Vector3()).toArray());
    const corner = node.getVertexPosition(0, new Vector3()).applyMatrix4(node.matrixWorld).toArray();
    figures.push({ joints, corner });
  });
  said.push(figures);
}
console.log(JSON.stringify(said));
