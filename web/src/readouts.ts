// What tests read of the page: window.cospeechStudio.

import { Box3, Vector3 } from "three";
import type { Crowd } from "./crowd";
import { placeOf } from "./figure";
import type { Live } from "./live";
import type { Player } from "./player";
import type { Stage } from "./stage";
import type { Store } from "./state";

interface Sources {
  store: Store;
  player: Player;
  live: Live;
  stage: Stage;
  crowd: () => Crowd | null;
  /** The time of the pose that is shown. */
  shownTime: () => number;
}

export function publishReadOuts({ store, player, live, stage, crowd, shownTime }: Sources): void {
  const readOuts = {
    get time() { return player.time; },
    get shownTime() { return shownTime(); },
    get playing() { return player.playing; },
    get speed() { return player.speed; },
    get frame() { return store.take.motion?.frameAt(player.time) ?? -1; },
    get frames() { return store.take.motion?.frames ?? 0; },
    get drawn() { return stage.drawn; },
    get liveFrames() { return live.frames; },
    get speech() { return store.state.speech; },
    get settings() { return store.state.settings; },
    get selection() { return store.state.selection; },
    get takes() {
      return store.state.takes.map(({ seed, id, making, progress, problem, motion, plan, edited, factor }) => ({
        seed, id, making, progress, problem, frames: motion?.frames ?? 0, plan, edited: edited !== null, factor,
      }));
    },
    get characters() { return crowd()?.count ?? 0; },
    jawOpen: (k = store.state.chosen) => crowd()?.figure(k).jawOpen() ?? 0,
    /** The lowest and the highest place of a character, metres. */
    extent: (k = store.state.chosen) => {
      const figure = crowd()?.figure(k);
      if (!figure) return null;
      const { min, max } = new Box3().setFromObject(figure.root);
      return [min.y, max.y];
    },
    joint: (name: string, k = store.state.chosen) => {
      const figure = crowd()?.figure(k);
      return figure ? placeOf(figure, name) : null;
    },
    /** How a bone is turned in what it hangs on. */
    turn: (name: string, k = store.state.chosen) => crowd()?.figure(k).bone(name)?.quaternion.toArray() ?? null,
    /** Node of the character's file → the weights of its shapes; for a face, if one is given. */
    shapes: (face?: number[], k = store.state.chosen) => {
      const rig = crowd()?.figure(k).face;
      if (rig && face) rig.apply(rig.driversOf(face));
      return rig?.listWeights() ?? null;
    },
    /** Where a joint is in the picture: 0 to 1 from the left and from the top. */
    onScreen: (name: string, k = store.state.chosen) => {
      const place = crowd()?.figure(k).bone(name)?.getWorldPosition(new Vector3()).project(stage.camera);
      return place ? [(place.x + 1) / 2, (1 - place.y) / 2] : null;
    },
  };
  Object.assign(window, { cospeechStudio: readOuts });
}
