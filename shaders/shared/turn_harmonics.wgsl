// Rotation of the bands of spherical harmonics by a quaternion: about z, y and z, and the one about y as a rotation about z
// between two exchanges of y and z. About z, only pairs of coefficients mix.

// Cosine and sine of the three angles about z: first, between the exchanges, and last.
struct TurnAngles {
  before: vec2f,
  middle: vec2f,
  after: vec2f,
}

fn angles_of(q: vec4f) -> TurnAngles {
  let upright = length(q.wz);
  let tilted = length(q.xy);
  // Cosine and sine of half the sum, and of half the difference, of the first and the last angle.
  let sum = select(vec2f(1.0, 0.0), q.wz / upright, upright > 1e-6);
  let difference = select(vec2f(1.0, 0.0), q.yx / tilted, tilted > 1e-6);
  return TurnAngles(
    vec2f(sum.x * difference.x - sum.y * difference.y, sum.y * difference.x + sum.x * difference.y),
    vec2f(upright * upright - tilted * tilted, -2.0 * upright * tilted),
    vec2f(sum.x * difference.x + sum.y * difference.y, sum.y * difference.x - sum.x * difference.y),
  );
}

fn turn_about_z(band: ptr<function, array<vec3f, 7>>, l: u32, angle: vec2f) {
  var own = angle;
  for (var m = 1u; m <= l; m++) {
    let plus = (*band)[l + m];
    let minus = (*band)[l - m];
    (*band)[l + m] = own.x * plus - own.y * minus;
    (*band)[l - m] = own.y * plus + own.x * minus;
    own = vec2f(own.x * angle.x - own.y * angle.y, own.y * angle.x + own.x * angle.y);
  }
}

// Coefficients of a function in whose argument y and z are exchanged.
fn exchange(band: ptr<function, array<vec3f, 7>>, l: u32) {
  let b = *band;
  switch l {
    case 1u: {
      (*band)[0] = -b[1];
      (*band)[1] = -b[0];
    }
    case 2u: {
      (*band)[0] = -b[3];
      (*band)[3] = -b[0];
      (*band)[2] = -0.5 * b[2] - 0.8660254037844386 * b[4];
      (*band)[4] = -0.8660254037844386 * b[2] + 0.5 * b[4];
    }
    default: {
      (*band)[0] = 0.7905694150420949 * b[3] - 0.6123724356957945 * b[5];
      (*band)[2] = 0.6123724356957945 * b[3] + 0.7905694150420949 * b[5];
      (*band)[3] = 0.7905694150420949 * b[0] + 0.6123724356957945 * b[2];
      (*band)[4] = -0.25 * b[4] - 0.9682458365518543 * b[6];
      (*band)[5] = -0.6123724356957945 * b[0] + 0.7905694150420949 * b[2];
      (*band)[6] = -0.9682458365518543 * b[4] + 0.25 * b[6];
    }
  }
}

fn turn_band(band: ptr<function, array<vec3f, 7>>, l: u32, angles: TurnAngles) {
  turn_about_z(band, l, angles.before);
  exchange(band, l);
  turn_about_z(band, l, angles.middle);
  exchange(band, l);
  turn_about_z(band, l, angles.after);
}
