// Examples that each show one thing. A view is what the address of the page holds.

const HOUSE = 'map=instructions/house.yaml&start=27,30&goal=135,95';
const lane = (name, kind, width, coordinates) => ({
  type: 'Feature',
  properties: { name, kind, width },
  geometry: { type: 'LineString', coordinates },
});
const RULES = [
  lane('into the room', 'one_way', 1, [[7, 5.8], [7, 4.4]]),
  lane('hall lane', 'keep_right', 1.4, [[1, 6], [15, 6]]),
];
const DEMO = 'map=demo.json:0&start=39,18&goal=7,19';

export const EXAMPLES = [
  {
    name: 'Instruction kept',
    about: 'Each part of it is measured on the path.',
    view: `${HOUSE}&instruction=visit the blue bedroom, avoid the dining room`,
  },
  {
    name: 'Impossible',
    about: 'No path can keep it, and the page says why.',
    view: `${HOUSE}&instruction=avoid the hall`,
  },
  {
    name: 'A question',
    about: 'What is doubtful is asked before anything is claimed.',
    view: `${HOUSE}&instruction=visit the livng room`,
  },
  {
    name: 'A drawn wall',
    about: 'The violet wall was drawn here, and the path goes around. Draw your own.',
    view: `${HOUSE}&walls=6ps.i.3y.i.3y.i`,
  },
  {
    name: 'Good waypoints',
    about: 'The points of a learned model lead the search; the small maps do without.',
    view: 'map=instructions/museum.yaml&start=20,20&goal=100,90&method=llm_astar&source=embedded',
  },
  {
    name: 'Bad waypoints',
    about: 'A reply as a model may write it: what became of each point is listed below.',
    view: `${DEMO}&method=llm_astar&source=reply&reply=Generated Path: [[45, 27], [3, 3], [45, 3], [20, 20], [60, 99]]`,
  },
  {
    name: 'Graded costs',
    about: 'The violet cells were drawn and cost twice as much, so the path takes the other door.',
    view: `${HOUSE}&costs=50.53q.w.3k.w.3k.w.3k.w.3k.w.3k.w.3k.w.3k.w.3k.w`,
  },
  {
    name: 'Why not?',
    about: 'A question about the path is answered by an exact search; the other path is dashed.',
    view: `${HOUSE}&why=why not through the green bathroom?`,
  },
  {
    name: 'No path',
    about: 'The smallest cause is named and marked, with the radius that would pass.',
    view: `${HOUSE}&robot_radius=0.6`,
  },
  {
    name: 'Several ways',
    about: 'Each passes an obstacle on another side and is the shortest that does.',
    view: `${DEMO}&alternatives=3`,
  },
  {
    name: 'Rules of the road',
    about: 'A one-way and a lane that keeps right were drawn here; draw your own with Zone.',
    view: `${HOUSE}&drawn=${JSON.stringify(RULES)}`,
  },
  {
    name: 'The paper',
    about: 'LLM-A* of arXiv 2407.02511 beside A*, by the cells that each expands.',
    view: `${DEMO}&method=llm_astar&source=embedded`,
  },
];

/** Show the examples as buttons; `onChosen(view)` is called with the view of one. */
export function showExamples(element, onChosen) {
  element.replaceChildren(
    ...EXAMPLES.map(({ name, view }) => {
      const button = document.createElement('button');
      button.type = 'button';
      button.textContent = name;
      button.addEventListener('click', () => onChosen(view));
      return button;
    }),
  );
}

/** Mark the example of a view, null for none, and say what it shows. */
export function markExample(element, about, view) {
  const chosen = EXAMPLES.findIndex((example) => example.view === view);
  [...element.children].forEach((button, i) =>
    button.setAttribute('aria-pressed', String(i === chosen)),
  );
  about.textContent = EXAMPLES[chosen]?.about ?? '';
}
