// The characters on the stage: one for each take, all of one kind.

import { Problem } from "./api";
import { Mannequin, type Figure } from "./figure";
import { makePose, type Pose } from "./motion";
import type { Stage } from "./stage";
import type { Catalogue } from "./messages";
import type { Take } from "./state";

const SHAPES = { ARKit: "shapes of ARKit", VRM: "expressions of VRM", Oculus: "visemes of Oculus" };

export class Crowd {
  private figures: Figure[] = [];
  private readonly pose: Pose;
  private target = 1;
  private filling: Promise<void> | null = null;
  /** Of the character's own, its file's name. */
  name = "";

  private constructor(private readonly stage: Stage, private readonly catalogue: Catalogue, private first: Figure, private readonly mannequin: Figure) {
    this.pose = makePose(catalogue.joints.length, catalogue.weights.length);
    this.pose.root.set(catalogue.rest[0]);
    this.figures = [first];
    stage.setPeople([first.root]);
  }

  static async open(stage: Stage, catalogue: Catalogue): Promise<Crowd> {
    const mannequin = await Mannequin.load("/api/mannequin", catalogue.joints, catalogue.weights);
    return new Crowd(stage, catalogue, mannequin, mannequin);
  }

  /** Have as many characters as takes. */
  async setCount(count: number): Promise<void> {
    this.target = count;
    this.filling ??= this.fill().finally(() => (this.filling = null));
    await this.filling;
  }

  private async fill(): Promise<void> {
    if (this.figures.length === this.target) return;
    while (this.figures.length < this.target) {
      const { first } = this;
      const figure = await first.copy();
      if (first === this.first) this.figures.push(figure);
      else figure.dispose();
    }
    for (const figure of this.figures.splice(this.target)) figure.dispose();
    this.stage.setPeople(this.figures.map((figure) => figure.root));
  }

  /** Somebody's own character in the place of ours; the file is read here and goes nowhere. */
  async wear(file: File): Promise<void> {
    const { loadAvatar } = await import("./avatar");
    const figure = await loadAvatar(await file.arrayBuffer(), file.name, this.catalogue);
    this.name = file.name;
    await this.replace(figure);
  }

  async wearMannequin(): Promise<void> {
    this.name = "";
    await this.replace(this.mannequin);
  }

  private async replace(first: Figure): Promise<void> {
    if (first === this.first) return;
    const old = this.figures;
    this.first = first;
    this.figures = [first];
    this.stage.setPeople([first.root]);
    for (const figure of old) if (figure !== this.mannequin) figure.dispose();
    await this.filling;
    await this.setCount(this.target);
    this.stage.frame();
  }

  /** Everybody as they are at a time in seconds; who has no motion yet rests. */
  show(takes: Take[], time: number): void {
    takes.forEach((take, k) => {
      const figure = this.figures[k];
      if (figure === undefined || take.motion === null) return;
      take.motion.sample(time, this.pose);
      figure.show(this.pose);
    });
  }

  showPose(pose: Pose): void {
    this.figures[0]?.show(pose);
  }

  /** By what the face of the character's own moves, in words; nothing of our mannequin. */
  describeFace(): string {
    const { face } = this.first;
    if (face === undefined) return "";
    if (!face.alphabet) return "Its face cannot be moved: no shape has a name of ARKit, VRM or Oculus.";
    return `Its face moves by ${SHAPES[face.alphabet]}.`;
  }

  figure(k: number): Figure {
    const figure = this.figures[k];
    if (figure === undefined) throw new Problem(`there is no character ${k}`);
    return figure;
  }

  get count(): number {
    return this.figures.length;
  }
}
