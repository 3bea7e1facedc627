// Lights of a three.js scene that follow a session: axes and units are the same.
// The strongest few cast shadows: WebGL has 16 textures to go round. A DirectionalLight is a point,
// so light that comes from wide discs has hard shadows. three.js multiplies irradiance with
// albedo / π, as we do, and its harmonics have the same order and signs as ours.

const MOST_SHADOWS = 4;
const DISTANCE_M = 10;

export class LightRig {
  #lights = [];

  constructor(THREE, scene) {
    this.THREE = THREE;
    this.group = new THREE.Group();
    this.fill = new THREE.LightProbe();
    this.group.add(this.fill);
    scene.add(this.group);
  }

  // Lights that are not valid are not shown: those before stay.
  show({ valid, lights }) {
    if (!valid) return;
    const lit = lights.lights
      .filter(({ irradiance }) => Math.max(...irradiance) > 0)
      .sort((one, other) => Math.max(...other.irradiance) - Math.max(...one.irradiance));
    while (this.#lights.length < lit.length) this.#lights.push(this.#newLight());
    this.#lights.forEach((light, index) => {
      light.visible = index < lit.length;
      if (light.visible) place(light, lit[index]);
    });
    const coefficients = lights.fill.length ? lights.fill : Array(9).fill([0, 0, 0]);
    coefficients.forEach((rgb, index) => this.fill.sh.coefficients[index].set(...rgb));
  }

  #newLight() {
    const light = new this.THREE.DirectionalLight();
    light.castShadow = this.#lights.length < MOST_SHADOWS;
    light.shadow.mapSize.set(1024, 1024);
    Object.assign(light.shadow.camera, { left: -3, right: 3, top: 3, bottom: -3, far: 2 * DISTANCE_M });
    light.shadow.normalBias = 0.02;
    this.group.add(light, light.target);
    return light;
  }
}

function place(light, { direction, irradiance }) {
  const strength = Math.max(...irradiance);
  light.position.set(...direction.map((value) => DISTANCE_M * value));
  light.color.setRGB(...irradiance.map((value) => value / strength));
  light.intensity = strength;
}
