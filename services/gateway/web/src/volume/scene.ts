// The only file that imports vtk.js; loaded when a volume is first shown. Everything is drawn from 8-bit values of the
// displayed range, and at no more pixels than the machine draws in time: a picture that follows matters more than
// one that is sharp.
import "@kitware/vtk.js/Rendering/OpenGL/Profiles/Geometry";
import "@kitware/vtk.js/Rendering/OpenGL/Profiles/Volume";
import vtkDataArray from "@kitware/vtk.js/Common/Core/DataArray";
import vtkImageData from "@kitware/vtk.js/Common/DataModel/ImageData";
import vtkPiecewiseFunction from "@kitware/vtk.js/Common/DataModel/PiecewiseFunction";
import vtkPlane from "@kitware/vtk.js/Common/DataModel/Plane";
import vtkImageMarchingCubes from "@kitware/vtk.js/Filters/General/ImageMarchingCubes";
import vtkOutlineFilter from "@kitware/vtk.js/Filters/General/OutlineFilter";
import vtkInteractorStyleTrackballCamera from "@kitware/vtk.js/Interaction/Style/InteractorStyleTrackballCamera";
import vtkActor from "@kitware/vtk.js/Rendering/Core/Actor";
import vtkColorTransferFunction from "@kitware/vtk.js/Rendering/Core/ColorTransferFunction";
import vtkMapper from "@kitware/vtk.js/Rendering/Core/Mapper";
import vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import vtkRenderWindow from "@kitware/vtk.js/Rendering/Core/RenderWindow";
import vtkRenderWindowInteractor from "@kitware/vtk.js/Rendering/Core/RenderWindowInteractor";
import vtkVolume from "@kitware/vtk.js/Rendering/Core/Volume";
import vtkVolumeMapper from "@kitware/vtk.js/Rendering/Core/VolumeMapper";
import vtkOpenGLRenderWindow from "@kitware/vtk.js/Rendering/OpenGL/RenderWindow";
import { maps } from "../colour";
import type { CameraPose, Look, Shape } from "./look";

const kFrame_ms = { good: 50, aim: 90, bad: 160 }; // outside of good and bad, more or fewer pixels
const kFirst_px = 120_000;
const kFewest_px = 30_000;

export class Scene {
  private readonly renderer = vtkRenderer.newInstance({ background: [0, 0, 0] });
  private readonly window = vtkRenderWindow.newInstance();
  private readonly canvas = vtkOpenGLRenderWindow.newInstance();
  private readonly interactor = vtkRenderWindowInteractor.newInstance();
  private readonly image = vtkImageData.newInstance();
  private readonly mapper = vtkVolumeMapper.newInstance();
  private readonly volume = vtkVolume.newInstance();
  private readonly colours = vtkColorTransferFunction.newInstance();
  private readonly opacity = vtkPiecewiseFunction.newInstance();
  private readonly contour = vtkImageMarchingCubes.newInstance({ contourValue: 128, computeNormals: true, mergePoints: true });
  private readonly surfaceMapper = vtkMapper.newInstance({ scalarVisibility: false });
  private readonly surface = vtkActor.newInstance();
  private readonly outlineFilter = vtkOutlineFilter.newInstance();
  private readonly plane = vtkPlane.newInstance();
  private look: Look | null = null;
  private values: Uint8Array<ArrayBuffer> = new Uint8Array(0);
  private shape = "";
  private pixels = 0; // that are drawn; the page enlarges them
  private scheduled = 0;
  private needsContour = true;
  private disposed = false;
  private cameraListener: ((pose: CameraPose) => void) | null = null;
  render_ms = 0;

  constructor(private readonly box: HTMLElement, private readonly onDrawn: () => void) {
    this.window.addRenderer(this.renderer);
    this.window.addView(this.canvas);
    this.canvas.setContainer(box);
    const element = this.canvas.getCanvas() as HTMLCanvasElement;
    element.setAttribute("aria-hidden", "true");
    this.interactor.setView(this.canvas);
    this.interactor.initialize();
    this.interactor.setInteractorStyle(vtkInteractorStyleTrackballCamera.newInstance());
    (this.interactor as any).bindEvents(box);
    this.mapper.setInputData(this.image);
    this.mapper.setAutoAdjustSampleDistances(false);
    this.mapper.setMaximumSamplesPerRay(400);
    this.volume.setMapper(this.mapper);
    const property = this.volume.getProperty();
    property.setRGBTransferFunction(0, this.colours);
    property.setScalarOpacity(0, this.opacity);
    property.setInterpolationTypeToLinear();
    this.contour.setInputData(this.image);
    this.surfaceMapper.setInputConnection(this.contour.getOutputPort());
    this.surface.setMapper(this.surfaceMapper);
    this.outlineFilter.setInputData(this.image);
    const outlineMapper = vtkMapper.newInstance();
    outlineMapper.setInputConnection(this.outlineFilter.getOutputPort());
    const outline = vtkActor.newInstance();
    outline.setMapper(outlineMapper);
    outline.getProperty().setColor(0.55, 0.6, 0.66);
    outline.getProperty().setLighting(false);
    this.renderer.addActor(outline);
    this.renderer.addActor(this.surface);
    this.renderer.addVolume(this.volume);
    this.renderer.getActiveCamera().onModified(() => this.cameraMoved());
    this.resize();
  }

  dispose(): void {
    this.disposed = true;
    cancelAnimationFrame(this.scheduled);
    (this.interactor as any).unbindEvents?.();
    this.interactor.delete();
    this.window.delete();
    this.canvas.delete();
  }

  resize(): void {
    const { width, height } = this.box.getBoundingClientRect();
    if (width < 2 || height < 2) return;
    const ratio = Math.min(window.devicePixelRatio, 2);
    const full = width * height * ratio * ratio;
    if (this.pixels === 0) this.pixels = Math.min(full, kFirst_px);
    const scale = ratio * Math.min(1, Math.sqrt(this.pixels / full));
    this.canvas.setSize(Math.round(width * scale), Math.round(height * scale));
    if (this.values.length > 0) this.window.render(); // at once: a new size has wiped the picture
  }

  // Values 0 to 255 of the displayed range, (nz, ny, nx).
  setValues(shape: Shape, values: Uint8Array<ArrayBuffer>): void {
    const key = JSON.stringify(shape);
    const isNew = key !== this.shape;
    if (isNew) {
      this.image.setDimensions(shape.size);
      this.image.setSpacing(shape.spacing_mm);
      this.image.setOrigin(shape.origin_mm);
      this.shape = key;
    }
    this.values = values;
    this.image.getPointData().setScalars(vtkDataArray.newInstance({ name: "emission", values, numberOfComponents: 1 }));
    this.image.modified();
    const side = Math.min(...shape.spacing_mm);
    this.mapper.setSampleDistance(side);
    this.volume.getProperty().setScalarOpacityUnitDistance(0, 4 * side);
    this.needsContour = true;
    if (isNew) this.resetCamera();
    if (this.look) this.setLook(this.look);
    this.schedule();
  }

  setLook(look: Look): void {
    this.look = look;
    this.volume.setVisibility(look.mode !== "surface");
    this.surface.setVisibility(look.mode === "surface" || look.mode === "both");
    if (look.mode === "brightest") this.mapper.setBlendModeToMaximumIntensity();
    else this.mapper.setBlendModeToComposite();
    const table = maps[look.map];
    this.colours.removeAllPoints();
    for (let i = 0; i < 256; i += 15) this.colours.addRGBPoint(i, table[3 * i] / 255, table[3 * i + 1] / 255, table[3 * i + 2] / 255);
    this.opacity.removeAllPoints();
    const top = look.mode === "brightest" ? 1 : look.opacity;
    if (look.map === "difference") {
      const dead = 127 * look.threshold;
      for (const [value, alpha] of [[0, top], [127 - dead, 0], [128 + dead, 0], [255, top]]) this.opacity.addPoint(value, alpha);
    } else {
      const start = 255 * look.threshold;
      this.opacity.addPoint(start, 0);
      this.opacity.addPoint(start + 0.35 * (255 - start), 0.35 * top);
      this.opacity.addPoint(255, top);
      if (start > 0) this.opacity.addPoint(0, 0);
    }
    const level = Math.round(255 * look.iso);
    if (this.contour.getContourValue() !== level) {
      this.contour.setContourValue(level);
      this.needsContour = true;
    }
    const colour = Math.min(255, level + 30);
    this.surface.getProperty().setColor(table[3 * colour] / 255, table[3 * colour + 1] / 255, table[3 * colour + 2] / 255);
    this.surface.getProperty().setOpacity(look.mode === "both" ? 0.45 : 1);
    this.clip(look);
    this.schedule();
  }

  private clip(look: Look): void {
    this.mapper.removeAllClippingPlanes();
    this.surfaceMapper.removeAllClippingPlanes();
    if (look.clip === "none") return;
    const axis = "xyz".indexOf(look.clip);
    const bounds = this.image.getBounds();
    const low = bounds[2 * axis];
    const high = bounds[2 * axis + 1];
    const origin: [number, number, number] = [0, 0, 0];
    const normal: [number, number, number] = [0, 0, 0];
    origin[axis] = low + look.clipAt * (high - low);
    normal[axis] = -1;
    this.plane.setOrigin(origin);
    this.plane.setNormal(normal);
    this.mapper.addClippingPlane(this.plane);
    this.surfaceMapper.addClippingPlane(this.plane);
  }

  resetCamera(): void {
    const camera = this.renderer.getActiveCamera();
    const bounds = this.image.getBounds();
    const centre = [0, 1, 2].map((i) => (bounds[2 * i] + bounds[2 * i + 1]) / 2) as [number, number, number];
    camera.setFocalPoint(...centre);
    camera.setPosition(centre[0] + 60, centre[1] + 45, centre[2] + 100);
    camera.setViewUp(0, 1, 0);
    this.renderer.resetCamera();
    this.schedule();
  }

  rotate(angle_deg: number): void {
    this.renderer.getActiveCamera().azimuth(angle_deg);
    this.schedule();
  }
  tilt(angle_deg: number): void {
    const camera = this.renderer.getActiveCamera();
    camera.elevation(angle_deg);
    camera.orthogonalizeViewUp();
    this.schedule();
  }
  zoom(factor: number): void {
    this.renderer.getActiveCamera().dolly(factor);
    this.schedule();
  }

  pose(): CameraPose {
    const camera = this.renderer.getActiveCamera();
    return { position: camera.getPosition(), focalPoint: camera.getFocalPoint(), viewUp: camera.getViewUp() };
  }
  setPose(pose: CameraPose): void {
    const listener = this.cameraListener;
    this.cameraListener = null; // no echo
    const camera = this.renderer.getActiveCamera();
    camera.setPosition(...pose.position);
    camera.setFocalPoint(...pose.focalPoint);
    camera.setViewUp(...pose.viewUp);
    this.cameraListener = listener;
    this.schedule();
  }
  onCamera(listener: (pose: CameraPose) => void): void {
    this.cameraListener = listener;
  }

  private cameraMoved(): void {
    this.cameraListener?.(this.pose());
    this.schedule();
  }

  schedule(): void {
    if (this.scheduled || this.disposed) return;
    this.scheduled = requestAnimationFrame(() => {
      this.scheduled = 0;
      this.draw();
    });
  }

  private draw(): void {
    if (this.disposed || this.values.length === 0) return;
    const surface = this.look?.mode === "surface" || this.look?.mode === "both";
    if (surface && this.needsContour) {
      this.contour.update();
      this.needsContour = false;
    }
    const begin = performance.now();
    this.renderer.resetCameraClippingRange();
    this.window.render();
    // Software rendering works behind our back: reading one pixel waits for it.
    const context = (this.canvas as any).get3DContext?.() as WebGL2RenderingContext | undefined;
    context?.readPixels(0, 0, 1, 1, context.RGBA, context.UNSIGNED_BYTE, new Uint8Array(4));
    const taken = performance.now() - begin;
    this.render_ms = this.render_ms ? 0.7 * this.render_ms + 0.3 * taken : taken;
    this.adapt();
    this.onDrawn();
  }

  private adapt(): void {
    if (this.render_ms <= kFrame_ms.bad && this.render_ms >= kFrame_ms.good) return;
    const wanted = this.pixels * Math.min(1.5, Math.max(0.25, kFrame_ms.aim / this.render_ms));
    const { width, height } = this.box.getBoundingClientRect();
    const ratio = Math.min(window.devicePixelRatio, 2);
    const next = Math.max(kFewest_px, Math.min(width * height * ratio * ratio, wanted));
    if (Math.abs(next / this.pixels - 1) < 0.1) return;
    this.pixels = next;
    this.render_ms = 0;
    this.resize();
  }
}
