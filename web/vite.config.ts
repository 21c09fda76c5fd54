// Two builds into one folder of the Python package: the page of the studio, and the viewer that a share file holds.
// Each writes the licences of the libraries in it: whoever passes the libraries on has to pass these on, too.
import { defineConfig } from "vite";

const folder = "../src/cospeech/assets/studio";

export default defineConfig(({ mode }) =>
  mode === "share"
    ? {
        publicDir: false,
        build: {
          outDir: folder,
          emptyOutDir: false,
          cssCodeSplit: false,
          license: { fileName: "viewer-licenses.txt" },
          lib: { entry: "src/share.ts", formats: ["iife"], name: "cospeechShare", fileName: () => "viewer.js", cssFileName: "viewer" },
        },
      }
    : {
        base: "./",
        build: {
          outDir: folder,
          emptyOutDir: true,
          license: { fileName: "licenses.txt" },
          chunkSizeWarningLimit: 1000,
          modulePreload: { polyfill: false },
        },
      },
);
