declare module "@kitware/vtk.js/Filters/General/ImageMarchingCubes" {
  const vtkImageMarchingCubes: { newInstance(options: { contourValue: number; computeNormals: boolean; mergePoints: boolean }): any };
  export default vtkImageMarchingCubes;
}
declare module "@kitware/vtk.js/Rendering/OpenGL/Profiles/Volume";
declare module "@kitware/vtk.js/Rendering/OpenGL/Profiles/Geometry";
declare module "@kitware/vtk.js/Rendering/OpenGL/RenderWindow" {
  const vtkOpenGLRenderWindow: { newInstance(options?: object): any };
  export default vtkOpenGLRenderWindow;
}
declare module "@kitware/vtk.js/Filters/General/OutlineFilter" {
  const vtkOutlineFilter: { newInstance(options?: object): any };
  export default vtkOutlineFilter;
}
