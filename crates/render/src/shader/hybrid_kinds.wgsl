// Which kind of primitive a pass draws.
override kind: u32 = 0u;
const TRIANGLES: u32 = 0u;
const POINTS: u32 = 1u;
const LINES: u32 = 2u;
