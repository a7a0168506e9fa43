/** All features of the element. The order is that of their calls: see {@link Feature}. */
import { autoRotate, motion } from '../features/auto-rotate/row.js';
import { children } from '../features/children/row.js';
import { credits } from '../features/credits/row.js';
import { doors } from '../features/doors/row.js';
import { effects } from '../features/effects/row.js';
import { flight } from '../features/flight/row.js';
import { groups } from '../features/groups/row.js';
import { announcer, input } from '../features/input/row.js';
import { labels } from '../features/labels/row.js';
import { print } from '../features/print/row.js';
import { recording } from '../features/recording/row.js';
import { ruler } from '../features/ruler/row.js';
import { shadow } from '../features/shadow/row.js';
import { sky } from '../features/sky/row.js';
import { sound } from '../features/sound/row.js';
import { views } from '../features/views/row.js';
import { walk } from '../features/walk/row.js';
import { ar, vr } from '../features/xr/row.js';
import type { FeatureTable } from './features.js';
// The declarations of the package keep these imports, whose rows add attributes and members to the types of the element.
import '../features/auto-rotate/row.js';
import '../features/credits/row.js';
import '../features/doors/row.js';
import '../features/effects/row.js';
import '../features/flight/row.js';
import '../features/groups/row.js';
import '../features/shadow/row.js';
import '../features/sky/row.js';
import '../features/sound/row.js';

export type { CreditsChangeDetail } from '../features/credits/row.js';
export type { MeasuredGroup } from '../features/groups/groups.js';
export type { InteractionPrompt, InteractionPromptStyle } from '../features/input/row.js';
export type { HotspotPlace } from '../features/labels/hotspot-controller.js';
export type { RoomChangeDetail } from '../features/doors/row.js';
export type { ImageOptions } from '../features/recording/capture-image.js';
export type { DepthOptions, MeasuredView } from '../features/recording/depth-image.js';
export type { FrameOptions, RecordOptions } from '../features/recording/recording.js';
export type { MeasureDetail } from '../features/ruler/row.js';
export type { ViewChangeDetail } from '../features/views/row.js';
export type { FlightOptions, PathOptions } from '../features/views/tour.js';
export type { WalkReadyDetail } from '../features/walk/row.js';
export type { ImmersiveStatusDetail } from '../features/xr/row.js';

const FEATURES: FeatureTable = {
  ...{ children, views, autoRotate, walk, flight, vr, ar, ruler, shadow, sky, sound, effects, groups, labels, doors },
  ...{ input, motion, announcer, print, recording, credits },
};

export default FEATURES;
