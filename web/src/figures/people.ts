/** Everybody in the picture: skinned or jointed figures near by, capsules farther off, plain shapes far away. */

import {
  CapsuleGeometry,
  Color,
  CylinderGeometry,
  Group,
  InstancedMesh,
  type Material,
  Matrix4,
  MeshLambertMaterial,
  MeshStandardMaterial,
  Quaternion,
  SphereGeometry,
  Vector3,
} from "three";
import { palette } from "../stage/palette";
import { type Body, Posture } from "./body";
import { mannequinOf } from "./mannequin";
import { merged } from "./shapes";
import type { Skin } from "./skin";

/** Somebody to be drawn now. */
export interface Shown {
  x: number;
  z: number;
  heading: number;
  /** Size of the body as a part of the usual one. */
  scale: number;
  colour: number;
  /** Full poses, and where in them this one begins; nothing where only the place is known. */
  roots: Float32Array | null;
  rotations: Float32Array | null;
  rootAt: number;
  rotationAt: number;
}

const CAPSULES_UNTIL = 45;
const MOST = 4096;

export class People {
  readonly group = new Group();
  private readonly pieces: { joint: number; mesh: InstancedMesh }[];
  private readonly capsules: InstancedMesh;
  private readonly plain: InstancedMesh;
  private readonly posture: Posture;
  private skin: Skin | null = null;
  private readonly matrix = new Matrix4();
  private readonly place = new Vector3();
  private readonly turn = new Quaternion();
  private readonly scale = new Vector3();
  private readonly up = new Vector3(0, 1, 0);
  private readonly colour = new Color();
  /** How many of each kind were drawn last. */
  readonly counts = { skinned: 0, jointed: 0, capsules: 0, plain: 0 };

  constructor(
    readonly body: Body,
    mostPoses = 160,
  ) {
    this.posture = new Posture(body);
    const matte = new MeshStandardMaterial({ vertexColors: true, roughness: 0.78, metalness: 0 });
    this.pieces = mannequinOf(body).map(({ joint, geometry }) => {
      const mesh = new InstancedMesh(geometry, matte, mostPoses);
      mesh.castShadow = mesh.receiveShadow = true;
      return { joint, mesh };
    });
    const height = body.standing * 1.82;
    this.capsules = this.instanced(capsule(height), matte, MOST);
    this.plain = this.instanced(plain(height), new MeshLambertMaterial({ vertexColors: false }), MOST);
    for (const { mesh } of this.pieces) this.group.add(this.ready(mesh));
  }

  /** Draw the nearest with a skin from now on. */
  wear(skin: Skin): void {
    this.skin = skin;
    this.group.add(skin.group);
  }

  private instanced(
    geometry: CapsuleGeometry | ReturnType<typeof merged>,
    material: Material,
    most: number,
  ): InstancedMesh {
    const mesh = new InstancedMesh(geometry, material, most);
    mesh.castShadow = true;
    this.group.add(this.ready(mesh));
    return mesh;
  }

  private ready(mesh: InstancedMesh): InstancedMesh {
    mesh.count = 0;
    mesh.frustumCulled = false;
    mesh.setColorAt(0, this.colour.set(palette.body));
    return mesh;
  }

  /** Draw these people, seen from a place. */
  show(people: Iterable<Shown>, eye: Vector3): void {
    const counts = this.counts;
    counts.skinned = counts.jointed = counts.capsules = counts.plain = 0;
    this.skin?.begin();
    const most = this.pieces[0]?.mesh.instanceMatrix.count ?? 0;
    for (const somebody of people) {
      this.colour.set(somebody.colour);
      if (somebody.roots && somebody.rotations) {
        const { roots, rotations, rootAt, rotationAt, scale } = somebody;
        if (this.skin?.add(roots, rootAt, rotations, rotationAt, scale, this.colour)) {
          counts.skinned++;
          continue;
        }
        if (counts.jointed < most) {
          this.posture.set(roots, rootAt, rotations, rotationAt, scale);
          for (const { joint, mesh } of this.pieces) {
            this.place.fromArray(this.posture.places, 3 * joint);
            this.turn.fromArray(this.posture.turns, 4 * joint);
            mesh.setMatrixAt(counts.jointed, this.matrix.compose(this.place, this.turn, this.scale.setScalar(scale)));
            mesh.setColorAt(counts.jointed, this.colour);
          }
          counts.jointed++;
          continue;
        }
      }
      const far = Math.hypot(somebody.x - eye.x, eye.y, somebody.z - eye.z) > CAPSULES_UNTIL;
      const mesh = far ? this.plain : this.capsules;
      const at = far ? counts.plain++ : counts.capsules++;
      if (at >= MOST) continue;
      this.place.set(somebody.x, 0, somebody.z);
      this.turn.setFromAxisAngle(this.up, somebody.heading);
      mesh.setMatrixAt(at, this.matrix.compose(this.place, this.turn, this.scale.setScalar(somebody.scale)));
      mesh.setColorAt(at, this.colour);
    }
    this.skin?.end();
    for (const { mesh } of this.pieces) finish(mesh, counts.jointed);
    finish(this.capsules, Math.min(MOST, counts.capsules));
    finish(this.plain, Math.min(MOST, counts.plain));
  }
}

function finish(mesh: InstancedMesh, count: number): void {
  if (mesh.count === 0 && count === 0) return;
  mesh.count = count;
  mesh.visible = count > 0;
  mesh.instanceMatrix.clearUpdateRanges();
  mesh.instanceMatrix.addUpdateRange(0, count * 16);
  mesh.instanceMatrix.needsUpdate = true;
  if (mesh.instanceColor) {
    mesh.instanceColor.clearUpdateRanges();
    mesh.instanceColor.addUpdateRange(0, count * 3);
    mesh.instanceColor.needsUpdate = true;
  }
}

/** Somebody without limbs: a rounded body, a head, and a chest that tells where they look. */
function capsule(height: number): ReturnType<typeof merged> {
  const trunk = new CapsuleGeometry(0.2, height * 0.62, 4, 14).scale(1.05, 1, 0.72).translate(0, height * 0.42, 0);
  const head = new SphereGeometry(height * 0.066, 14, 10).translate(0, height * 0.925, 0.012);
  const chest = new SphereGeometry(0.11, 10, 8).scale(1.2, 1.5, 0.6).translate(0, height * 0.68, 0.115);
  const parts = [trunk, head, chest];
  for (const part of parts) part.deleteAttribute("uv");
  return white(merged(parts));
}

/** Somebody far away: eight sides. */
function plain(height: number): ReturnType<typeof merged> {
  const trunk = new CylinderGeometry(0.19, 0.13, height * 0.84, 8, 1)
    .scale(1.05, 1, 0.75)
    .translate(0, height * 0.42, 0);
  const head = new SphereGeometry(height * 0.07, 6, 5).translate(0, height * 0.92, 0);
  for (const part of [trunk, head]) part.deleteAttribute("uv");
  return white(merged([trunk, head]));
}

function white(geometry: ReturnType<typeof merged>): ReturnType<typeof merged> {
  const count = geometry.attributes.position!.count;
  const colours = new Float32Array(count * 3).fill(1);
  const attribute = geometry.attributes.position!.clone();
  attribute.array = colours;
  geometry.setAttribute("color", attribute);
  return geometry;
}
